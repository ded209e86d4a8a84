#include "gap/diagnose/wheel_scale.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "gap/equations/power.h"
#include "gap/verdict/words.h"
#include "plausibility/faults.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

using plausibility::ChannelFault;

// Of the power, with any base load: as recorded, and in the right unit.
constexpr double recorded_gap = 0.5, unit_gap = 0.35;
constexpr double clearly = 0.5;  // of the gap of any other unit

double wheels_factor(const ChannelFault& fault) {
  const double right = fault.factor[plausibility::reading::wheel_velocity];
  const bool both = right == fault.factor[plausibility::reading::wheel_velocity + 1] && right > 0;
  return fault.channel == "wheel_velocity" && both ? right : 1;
}

std::vector<Window> slowed(std::span<const Window> windows, double factor) {
  std::vector<Window> all(windows.begin(), windows.end());
  for (Window& w : all) {
    for (const std::size_t s : {0u, 1u}) {
      w.speed_rad_s[s] /= factor;
      w.acceleration_rad_s2[s] /= factor;
      for (auto& part : w.part_speed_rad_s) part[s] /= factor;
      for (auto& part : w.part_acceleration_rad_s2) part[s] /= factor;
    }
  }
  return all;
}

}  // namespace

std::optional<Check> wheel_scale_by_power(const robot::RobotModel& robot,
                                          std::span<const dynamics::ActiveEffect> in_file,
                                          std::span<const Window> windows, std::span<const double> power_w) {
  // The gap with the base load that leaves least of it.
  const auto gap_at = [&](double factor) {
    std::vector<double> modelled = modelled_power(robot, in_file, {}, slowed(windows, factor)), apart;
    for (std::size_t k = 0; k < modelled.size(); ++k) {
      if (std::isfinite(power_w[k] - modelled[k])) apart.push_back(power_w[k] - modelled[k]);
    }
    const double load_w = apart.empty() ? 0 : statistics::median(std::move(apart));
    for (double& w : modelled) w += std::max(load_w, -robot.idle_power_w);
    return gap_size(power_w, modelled).absolute_relative;
  };
  const double gap = gap_at(1);
  if (!(gap > recorded_gap)) return std::nullopt;
  struct Tried {
    double gap;
    const ChannelFault* fault;
  };
  std::vector<Tried> tried;
  const std::vector<ChannelFault> faults = plausibility::known_faults(robot);
  for (const ChannelFault& fault : faults) {
    const double factor = wheels_factor(fault);
    if (factor == 1) continue;
    tried.push_back({gap_at(factor), &fault});
  }
  const auto best = std::ranges::min_element(tried, {}, &Tried::gap);
  if (best == tried.end() || best->gap > unit_gap || best->gap > clearly * gap) return std::nullopt;
  const double factor = wheels_factor(*best->fault);
  std::string also;
  for (const Tried& other : tried) {
    if (other.fault == best->fault || other.gap > best->gap / clearly) continue;
    also += (also.empty() ? "; " : " or ") + other.fault->cause;
  }
  const bool only = also.empty();
  if (!only) also += " would have nearly the same effect";
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  Check check{best->fault->id,
              best->fault->channel,
              factor,
              {unknown, unknown},
              fmt::format("wheel_velocity looks {}: as recorded, the robot file misses {} of the battery's "
                          "power with any base load, and of speeds divided by {:.3g} it misses {}; "
                          "joulecast expects rad/s at the wheel, positive forward, right before left{}.",
                          best->fault->cause, percent(gap), factor, percent(best->gap), also),
              true};
  if (only) check.factor = factor;
  return check;
}

std::optional<Check> wheel_scale_by_power(const robot::RobotModel& robot,
                                          const telemetry::RecordingSet& recordings) {
  const windows::Readings readings = windows::find_readings(recordings.missions);
  if (!from_motion_of(readings).power) return std::nullopt;
  std::vector<Window> all = windows::make_windows(recordings.missions, robot, readings);
  keep_known_motion(all);
  const auto in_file = dynamics::active_effects(robot);
  return in_file ? wheel_scale_by_power(robot, *in_file, all, measured_power(all, robot, false))
                 : std::nullopt;
}

}  // namespace joulecast::gap
