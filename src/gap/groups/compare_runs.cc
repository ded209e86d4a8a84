#include "base/try.h"
#include "gap/groups/comparer.h"
#include "gap/runs/run_rows.h"

namespace joulecast::gap {

Result<Comparison> compare_runs(const RunSet& set, std::span<const std::string> group_of_run,
                                const robot::RobotModel& robot, const Progress& progress) {
  TRY_ASSIGN(auto in_file, dynamics::active_effects(robot));
  Comparison c;
  const std::vector<std::size_t> groups = name_groups(group_of_run, c);
  if (c.groups.size() < 2) return invalid("--compare-by", "gives one group only; two are needed to compare");
  RunRows rows(set, robot, std::move(in_file));
  RunChecks checked = check_runs(rows, robot);
  c.diagnosis.checks = std::move(checked.checks);
  rows.silence(checked.apart);
  GroupedData grouped{rows.data(), rows.joules(), {}, rows.offsets_j()};
  for (const std::size_t group : groups) ++c.groups[group].missions, ++c.groups[group].samples;
  grouped.data.group = groups;
  for (const MissionRun& run : set.runs) grouped.way_m.push_back(run.at.distance_m);
  Diagnosis& d = c.diagnosis;
  d.robot_id = robot.robot_id;
  d.missions = d.samples = set.runs.size();
  d.motor_channels = rows.by_motor();
  d.power = d.motor_channels ? PowerSource::motors : PowerSource::battery;
  c.limits.emplace_back(
      "Groups may differ in more than their names: day, payload, tyres, batteries, weather.");
  compare_groups(std::move(grouped), progress, c);
  return c;
}

}  // namespace joulecast::gap
