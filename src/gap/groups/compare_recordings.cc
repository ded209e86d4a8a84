#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "gap/checks/check.h"
#include "gap/diagnose/channel_gaps.h"
#include "gap/diagnose/fit.h"
#include "gap/diagnose/naming.h"
#include "gap/diagnose/referee.h"
#include "gap/equations/power.h"
#include "gap/groups/comparer.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t min_group_windows = 20;  // of a group
constexpr double large_group_gap = 0.15, usual_group_share = 0.07, large_group_share = 0.3;
constexpr double progress_after_group_fit = 0.3;

// The recordings of all groups as windows, group after group.
struct Grouped {
  telemetry::RecordingSet recordings;
  std::vector<std::string> covariates;
  std::vector<std::size_t> group_of_mission, group_of_block;
  windows::Readings readings;
  std::vector<Window> windows;
  std::vector<double> power_w;
  PowerSource power = PowerSource::battery;
  FromMotion from_motion;
};

void sort_by_group(Grouped& g, std::span<const std::size_t> group_of_mission, std::size_t groups) {
  std::vector<telemetry::Recording> sorted;
  for (std::size_t group = 0; group < groups; ++group) {
    for (std::size_t m = 0; m < group_of_mission.size(); ++m) {
      if (group_of_mission[m] != group) continue;
      sorted.push_back(std::move(g.recordings.missions[m]));
      g.group_of_mission.push_back(group);
    }
  }
  g.recordings.missions = std::move(sorted);
}

// Blocks hold missions of one group only.
void assign_blocks(Grouped& g) {
  std::size_t blocks = 0, from = 0;
  while (from < g.windows.size()) {
    const std::size_t group = g.group_of_mission[g.windows[from].mission];
    std::size_t first = 0;
    while (g.group_of_mission[first] != group) ++first;
    std::size_t last = first;
    while (last < g.group_of_mission.size() && g.group_of_mission[last] == group) ++last;
    const std::span<const telemetry::Recording> missions(g.recordings.missions);
    std::size_t to = from;
    for (; to < g.windows.size() && g.group_of_mission[g.windows[to].mission] == group; ++to)
      g.windows[to].mission -= first;
    const std::size_t own = windows::assign_blocks(std::span(g.windows).subspan(from, to - from),
                                                   missions.subspan(first, last - first));
    for (std::size_t k = from; k < to; ++k) {
      g.windows[k].mission += first;
      g.windows[k].block += blocks;
    }
    blocks += own;
    g.group_of_block.resize(blocks, group);
    from = to;
  }
}

void make_windows(Grouped& g, const robot::RobotModel& robot) {
  g.covariates = windows::covariate_names(g.recordings.missions);
  g.readings = windows::find_readings(g.recordings.missions);
  g.windows = windows::make_windows(g.recordings.missions, robot, g.readings);
  keep_known_motion(g.windows);
  assign_blocks(g);
  g.from_motion = from_motion_of(g.readings);
  const auto known = [](double p) { return std::isfinite(p); };
  g.power_w = measured_power(g.windows, robot, false);
  if (std::ranges::any_of(g.power_w, known)) return;
  // Power from currents and the file's winding would say nothing that the currents do not.
  g.power = g.readings.motor_voltages ? PowerSource::motors : PowerSource::none;
  if (g.readings.motor_voltages) g.power_w = measured_power(g.windows, robot, true);
}

// The problem with the noise of each group its own: a quiet floor says more than a rough one.
Problem problem_of(const Linear& linear, const Grouped& g, std::size_t groups,
                   const std::vector<bool>& left_out) {
  Problem all;
  for (std::size_t group = 0; group < groups; ++group) {
    std::vector<bool> others(g.group_of_block.size());
    for (std::size_t b = 0; b < others.size(); ++b)
      others[b] = g.group_of_block[b] != group || (!left_out.empty() && left_out[b]);
    const Noise noise = learn_noise(*linear.columns, linear.rows, others);
    Problem own = make_problem(*linear.columns, linear.rows, noise, others.size());
    if (group == 0) {
      all = std::move(own);
      continue;
    }
    for (std::size_t n = 0; n < all.blocks.size(); ++n) {
      for (std::size_t b = 0; b < others.size(); ++b) {
        if (g.group_of_block[b] == group) all.blocks[n][b] = std::move(own.blocks[n][b]);
      }
    }
  }
  return all;
}

// Windows overlap by half.
double length_of(const Window& w) {
  return 0.5 * w.length_s;
}

// Fills groups; items of the comparison.
std::vector<Item> measure(const Grouped& g, const robot::RobotModel& robot, Comparison& c) {
  std::vector<Item> items;
  for (std::size_t m = 0; m < g.group_of_mission.size(); ++m) {
    ++c.groups[g.group_of_mission[m]].missions;
    c.groups[g.group_of_mission[m]].samples += g.recordings.missions[m].samples.size();
  }
  for (std::size_t k = 0; k < g.windows.size(); ++k) {
    const Window& w = g.windows[k];
    const double way_m =
        0.5 * robot.kinematics.wheel_radius_m * std::fabs(w.speed_rad_s[0] + w.speed_rad_s[1]) * length_of(w);
    const std::size_t group = g.group_of_mission[w.mission];
    items.push_back({group, w.block, g.power_w[k], length_of(w), length_of(w), way_m, length_of(w)});
    ComparedGroup& own = c.groups[group];
    const bool known = std::isfinite(g.power_w[k]);
    if (known || g.power == PowerSource::none) own.way_m += way_m;
    if (!known) continue;
    own.energy_per_m_j += g.power_w[k] * length_of(w);
  }
  for (ComparedGroup& own : c.groups) {
    own.energy_per_m_j /= g.power != PowerSource::none && own.way_m > 0 ? own.way_m : missing;
  }
  return items;
}

void add_limits(const Grouped& g, Comparison& c) {
  if (g.power == PowerSource::none) {
    c.limits.emplace_back(
        "Neither battery power nor the motors' was recorded: what the differences cost in watts, and all "
        "that lies "
        "between battery and motors, is not known.");
  }
  if (g.from_motion.power)
    c.limits.emplace_back("Without the motors' currents friction, motors and drivers share one equation.");
  c.limits.emplace_back(
      "A group is what its name says and whatever else was different that day: payload, tyres, batteries, "
      "weather.");
}

std::vector<double> refereed(const Material& m, const Grouped& g, std::size_t groups,
                             const std::vector<double>& missed, const std::vector<bool>& use) {
  std::vector<double> answer(missed.size(), 0);
  for (std::size_t group = 0; group < groups; ++group) {
    std::vector<bool> own(use);
    for (std::size_t k = 0; k < own.size(); ++k)
      own[k] = own[k] && g.group_of_mission[g.windows[k].mission] == group;
    const Referee referee(m, missed, own);
    for (std::size_t k = 0; k < own.size(); ++k) {
      if (g.group_of_mission[g.windows[k].mission] == group) answer[k] = referee.predict(g.windows[k]);
    }
  }
  return answer;
}

// The groups by name in `c`, and their windows; contradicted channels are silenced.
Result<Grouped> make_groups(const telemetry::RecordingSet& recordings,
                            std::span<const std::string> group_of_mission, const robot::RobotModel& robot,
                            Comparison& c) {
  const std::set<std::string> names(group_of_mission.begin(), group_of_mission.end());
  if (names.size() < 2) return invalid("log", "holds missions of one group only; two are needed to compare");
  for (const std::string& name : names) c.groups.push_back({name, 0, 0, 0, 0, 0});
  std::vector<std::size_t> index;
  for (const std::string& name : group_of_mission)
    index.push_back(static_cast<std::size_t>(std::distance(names.begin(), names.find(name))));
  Grouped g;
  g.recordings = recordings;
  std::vector<Check>& checks = c.diagnosis.checks;
  checks = check_recordings(g.recordings, robot);
  // What steps from one mission to the next is what is compared.
  std::erase_if(checks, [](const Check& check) { return check.id == "step_between_missions"; });
  silence_contradicted(g.recordings, checks);
  sort_by_group(g, index, names.size());
  make_windows(g, robot);
  std::vector<std::size_t> count(names.size(), 0);
  for (const Window& w : g.windows) ++count[g.group_of_mission[w.mission]];
  for (std::size_t k = 0; k < count.size(); ++k) {
    if (count[k] < min_group_windows)
      return invalid("log", "holds too little motion in group " + c.groups[k].name);
  }
  if (g.power == PowerSource::none && g.from_motion.power && !g.from_motion.voltage)
    return invalid("log", "measures neither power nor voltage nor current of the motors");
  return g;
}

// Of each group by itself, since what differs between groups is no noise; powers count as far as there are
// of them, other readings by how often they were read.
std::vector<ChannelGap> gaps_of_groups(const Material& all, const Grouped& g) {
  std::vector<ChannelGap> gaps;
  std::map<std::string, double> whole;
  for (std::size_t from = 0; from < g.windows.size();) {
    const std::size_t group = g.group_of_mission[g.windows[from].mission];
    double power = 0;
    std::size_t to = from;
    for (; to < g.windows.size() && g.group_of_mission[g.windows[to].mission] == group; ++to)
      power += std::isfinite(g.power_w[to]) ? std::fabs(g.power_w[to]) : 0;
    Material own = all;
    own.windows = all.windows.subspan(from, to - from);
    for (ChannelGap& gap : channel_gaps(own)) {
      const double size =
          gap.channel.ends_with("_power") && power > 0 ? power : static_cast<double>(to - from);
      gap.absolute_relative *= size, gap.noise_floor *= size;
      whole[gap.channel] += size;
      const auto sum = std::ranges::find(gaps, gap.channel, &ChannelGap::channel);
      if (sum == gaps.end()) {
        gaps.push_back(std::move(gap));
        continue;
      }
      sum->absolute_relative += gap.absolute_relative, sum->noise_floor += gap.noise_floor;
    }
    from = to;
  }
  for (ChannelGap& gap : gaps)
    gap.absolute_relative /= whole[gap.channel], gap.noise_floor /= whole[gap.channel];
  return gaps;
}

void describe(const telemetry::RecordingSet& recordings, const Grouped& g, const Material& material,
              Comparison& c) {
  Diagnosis& d = c.diagnosis;
  d.robot_id = recordings.robot_id;
  d.missions = recordings.missions.size();
  d.samples = recordings.samples;
  d.notes = recordings.notes;
  d.motor_channels = !g.from_motion.power;
  d.power = g.power;
  d.channels = gaps_of_groups(material, g);
  const auto floor = std::ranges::find(
      d.channels, g.power == PowerSource::battery ? "battery_power" : "motor_power", &ChannelGap::channel);
  d.noise_floor = g.power == PowerSource::none || floor == d.channels.end() ? missing : floor->noise_floor;
  add_limits(g, c);
}

Cause strengthened(Cause cause, const Eigen::VectorXd& coefficients) {
  if (coefficients.size() == 2) {
    cause.effect.values[0] = coefficients.norm();
    cause.effect.values[1] = std::atan2(coefficients[1], coefficients[0]);
  } else {
    cause.effect.values[cause.parameter] = coefficients[0];
  }
  return cause;
}

// Power of every window with the causes of its group.
std::vector<double> predicted(const Material& material, const Grouped& g,
                              const std::vector<std::vector<Cause>>& by_group) {
  std::vector<double> power_w;
  std::size_t from = 0;
  while (from < g.windows.size()) {
    const std::size_t group = g.group_of_mission[g.windows[from].mission];
    std::size_t to = from;
    while (to < g.windows.size() && g.group_of_mission[g.windows[to].mission] == group) ++to;
    const auto own = modelled_power(material.robot, material.adopted, by_group[group],
                                    std::span(g.windows).subspan(from, to - from));
    power_w.insert(power_w.end(), own.begin(), own.end());
    from = to;
  }
  return power_w;
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
                                      const robot::RobotModel& robot, const CompareSettings& settings) {
  const auto adopted = dynamics::active_effects(robot);
  if (!adopted) return tl::unexpected(adopted.error());
  Comparison c;
  const auto grouped = make_groups(recordings, group_of_mission, robot, c);
  if (!grouped) return tl::unexpected(grouped.error());
  const Grouped& g = *grouped;
  const std::size_t groups = c.groups.size();

  // Everything is linearised around what one finds in all groups.
  const Material material{robot,         *adopted,         g.windows,   g.group_of_block.size(),
                          g.from_motion, g.readings.row_s, g.covariates};
  FitSettings fit_settings;
  fit_settings.shares = {usual_group_share};
  const std::vector<double> unchanged = modelled_power(robot, *adopted, {}, g.windows);
  if (gap_size(g.power_w, unchanged).absolute_relative > large_group_gap)
    fit_settings.shares.push_back(large_group_share);
  const auto fit =
      fit_windows(material, {}, fit_settings, [&] { return !settings.progress || settings.progress(0.1); });
  if (!fit || (settings.progress && !settings.progress(progress_after_group_fit)))
    return fail(Fault::conflict, "", "comparison cancelled");

  describe(recordings, g, material, c);

  GroupedData data{robot};
  data.base = problem_of(fit->linear, g, groups, {});
  data.group_of_block = g.group_of_block;
  data.items = measure(g, robot, c);
  data.explain.most_members = 2;
  data.explain.most_families = 1;
  data.explain.candidate = true;
  data.around = fit->causes;
  data.explain.beam = 5;
  data.without = [&](const std::vector<bool>& out) { return problem_of(fit->linear, g, groups, out); };
  data.cause = [&](std::size_t h, const Eigen::VectorXd& coefficients) {
    return strengthened(fit->linear.columns->hypotheses()[h].cause(), coefficients);
  };
  data.predict = [&](const std::vector<std::vector<Cause>>& by_group) {
    return predicted(material, g, by_group);
  };
  data.referee = [&](const std::vector<double>& missed, const std::vector<bool>& use) {
    return refereed(material, g, groups, missed, use);
  };
  CompareSettings rest = settings;
  if (settings.progress)
    rest.progress = [&](double part) {
      return settings.progress(std::lerp(progress_after_group_fit, 1.0, part));
    };
  if (!compare_groups(data, rest, c)) return fail(Fault::conflict, "", "comparison cancelled");
  return c;
}

}  // namespace joulecast::gap
