#include <set>

#include "gap/groups/comparer.h"
#include "gap/runs/run_checks.h"

namespace joulecast::gap {

Result<Comparison> compare_runs(const RunSet& set, std::span<const std::string> group_of_run,
                                const robot::RobotModel& robot, const CompareSettings& settings) {
  auto in_file = dynamics::active_effects(robot);
  if (!in_file) return tl::unexpected(in_file.error());
  const std::set<std::string> names(group_of_run.begin(), group_of_run.end());
  if (names.size() < 2) return invalid("--compare-by", "gives one group only; two are needed to compare");
  Comparison c;
  for (const std::string& name : names) c.groups.push_back({name, 0, 0, 0, 0, 0});
  RunRows rows(set, robot, *std::move(in_file));
  RunChecks checked = check_runs(rows);
  c.diagnosis.checks = std::move(checked.checks);
  rows.silence(checked.apart);
  GroupedData grouped{rows.data(), rows.joules(), {}, rows.offsets_j()};
  for (const std::string& name : group_of_run) {
    const auto group = static_cast<std::size_t>(std::distance(names.begin(), names.find(name)));
    grouped.data.group.push_back(group);
    ++c.groups[group].missions, ++c.groups[group].samples;
  }
  for (const MissionRun& run : set.runs) grouped.way_m.push_back(run.at.distance_m);
  Diagnosis& d = c.diagnosis;
  d.robot_id = robot.robot_id;
  d.missions = d.samples = set.runs.size();
  d.motor_channels = rows.by_motor();
  d.power = d.motor_channels ? PowerSource::motors : PowerSource::battery;
  c.limits.emplace_back(
      "Groups may differ in more than their names: day, payload, tyres, batteries, weather.");
  const auto compared = compare_groups(std::move(grouped), settings, c);
  return compared ? Result<Comparison>(std::move(c)) : tl::unexpected(compared.error());
}

}  // namespace joulecast::gap
