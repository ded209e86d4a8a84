#include <algorithm>
#include <map>

#include "base/try.h"
#include "gap/diagnose/recordings.h"
#include "gap/groups/comparer.h"
#include "gap/verdict/answer.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t min_group_windows = 20;  // of a group

void add_limits(const posterior::Data& d, Comparison& c) {
  if (!d.power)
    c.limits.emplace_back(
        "Neither battery nor motor power was recorded: the cost of the differences in watts, and all losses "
        "between battery and motors, are undetermined.");
  if (!d.motors)
    c.limits.emplace_back("Without the motors' currents friction, motors and drivers share one equation.");
  c.limits.emplace_back(
      "Groups may differ in more than their names: payload, tyres, batteries, weather of the day.");
}

void describe(const telemetry::RecordingSet& recordings, const posterior::Data& d, Comparison& c) {
  for (std::size_t m = 0; m < d.group.size(); ++m) {
    ++c.groups[d.group[m]].missions;
    c.groups[d.group[m]].samples += recordings.missions[m].samples.size();
  }
  c.diagnosis.robot_id = recordings.robot_id;
  c.diagnosis.missions = recordings.missions.size();
  c.diagnosis.samples = recordings.samples;
  c.diagnosis.notes = recordings.notes;
  c.diagnosis.motor_channels = d.motors;
  c.diagnosis.power = power_source(d);
  add_limits(d, c);
}

}  // namespace

Result<std::vector<std::string>> groups_of(const telemetry::RecordingSet& recordings, const std::string& by) {
  std::vector<std::string> groups;
  for (const telemetry::Recording& mission : recordings.missions) {
    const std::string& id = mission.mission_id;
    if (by == "prefix") {
      groups.push_back(id.substr(0, id.find('-')));
      continue;
    }
    if (by == "suffix") {
      const auto at = id.rfind('_');
      groups.push_back(at == std::string::npos ? id : id.substr(at + 1));
      continue;
    }
    std::map<std::string, double> held_s;
    for (const signals::CovariateSeries& series : mission.covariates) {
      if (!series.name.starts_with(by + "=")) continue;
      for (std::size_t k = 0; k < series.value.size(); ++k) {
        const std::int64_t until =
            k + 1 < series.utime_us.size() ? series.utime_us[k + 1] : mission.samples.back().utime_us;
        if (series.value[k] == 1)
          held_s[series.name.substr(by.size() + 1)] += 1e-6 * static_cast<double>(until - series.utime_us[k]);
      }
    }
    if (held_s.empty()) return invalid("--compare-by", "mission " + id + " has no label " + by);
    groups.push_back(std::ranges::max_element(held_s, {}, [](const auto& h) { return h.second; })->first);
  }
  return groups;
}

Result<Comparison> compare_recordings(const telemetry::RecordingSet& recordings,
                                      std::span<const std::string> group_of_mission,
                                      const robot::RobotModel& file, const Progress& progress) {
  Comparison c;
  robot::RobotModel robot = file;
  std::vector<std::size_t> groups = name_groups(group_of_mission, c);
  if (c.groups.size() < 2)
    return invalid("log", "contains missions of one group only; a comparison needs two");
  telemetry::RecordingSet trusted = recordings;
  std::vector<Check>& checks = c.diagnosis.checks;
  checks = check_and_correct(trusted, robot);
  // Steps from one mission to the next are the subject of the comparison.
  std::erase_if(checks, [](const Check& check) { return check.id == "step_between_missions"; });
  TRY_ASSIGN(auto data, posterior::make_data(trusted.missions, robot));
  data.group = std::move(groups);
  std::vector<std::size_t> count(c.groups.size(), 0);
  for (const Window& w : data.windows) ++count[data.group[w.mission]];
  for (std::size_t k = 0; k < count.size(); ++k) {
    if (count[k] < min_group_windows)
      return invalid("log", "contains too little motion of group " + c.groups[k].name);
  }
  if (!data.power && !data.motors && !data.voltages)
    return invalid("log", "measures neither power nor voltage nor current of the motors");
  describe(trusted, data, c);
  // Rows are equally long.
  const Eigen::VectorXd speed = data.rows.mean(
      [&](const Window& w) { return windows::plain_terms(w, robot.kinematics.wheel_radius_m)[1]; });
  GroupedData grouped{std::move(data), {}, {speed.begin(), speed.end()}, {}};
  grouped.joule.assign(grouped.way_m.size(), 1);
  grouped.offset_j.assign(grouped.way_m.size(), 0);
  compare_groups(std::move(grouped), progress, c);
  return c;
}

}  // namespace joulecast::gap
