#include "telemetry/impossible.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace joulecast::telemetry {
namespace {

// A channel is frozen if it repeats a value for more than three times as many rows as in any of this many
// runs before (as the ROS bridge, which holds a value for three periods), for a second at least, while the
// motion changes by a quarter of its limit. No channel of the recordings of real robots in the tests
// and of sound virtual robots is frozen by this; without the change of motion, simulated currents at constant
// speed are. A reading of 0 belongs to rest, at which a motion begins to differ from it.
constexpr std::size_t frozen_runs = 3, fewest_runs = 20;
constexpr std::int64_t least_frozen_us = 1'000'000;
constexpr double least_varied = 0.25;

// The end of a counter of 16 or 32 bits in a decimal unit, or whole nines, by which devices and loggers state
// that there is no reading: 655.35, -32.768, -999. 99.9 is an amperage of real recordings.
bool means_no_reading(double value) {
  constexpr double least = 32.76, rounding = 1e-6;
  if (!(std::abs(value) > least)) return false;
  for (const double nines : {999.0, 9999.0, 99'999.0})
    if (std::abs(value) == nines) return true;
  for (const double units : {1.0, 10.0, 100.0, 1000.0})
    for (const double end : {32'767.0, 32'768.0, 65'535.0, 2'147'483'647.0, 4'294'967'295.0})
      if (std::abs(std::abs(value) * units / end - 1) < rounding) return true;
  return false;
}

}  // namespace

ImpossibleReadings::ImpossibleReadings(const robot::RobotModel& robot)
    : nominal_v_(robot.battery.nominal_voltage_v),
      speed_share_s_(robot.kinematics.wheel_radius_m / robot.limits.speed_m_s),
      turn_share_s_(robot.kinematics.wheel_radius_m /
                    (2 * robot.kinematics.half_track_m * robot.limits.yaw_rate_rad_s)) {}

// `counts`: the row shows whether the channel follows the motion.
bool ImpossibleReadings::frozen(Run& run, double value, double motion, std::int64_t utime_us,
                                bool counts) const {
  counts = counts || (value == 0 && std::fabs(motion) > least_varied);
  const bool beyond = run.runs >= fewest_runs && run.rows > frozen_runs * run.usual_rows;
  if (value != run.value) {
    const bool was_frozen = beyond && run.fastest - run.slowest > least_varied;
    if (run.rows > 0 && !was_frozen) {
      ++run.runs;
      run.usual_rows = std::max(run.usual_rows, run.rows);
    }
    run.value = value;
    run.begin_us = utime_us;
    run.rows = counts ? 1 : 0;
    run.slowest = run.fastest = value == 0 ? 0 : motion;  // 0 is read at rest
    return false;
  }
  run.rows += counts ? 1 : 0;
  run.slowest = std::min(run.slowest, motion);
  run.fastest = std::max(run.fastest, motion);
  return beyond && run.fastest - run.slowest > least_varied && utime_us - run.begin_us >= least_frozen_us;
}

std::optional<ImpossibleReadings::Dropped> ImpossibleReadings::drop(signals::Sample& sample) {
  std::optional<Dropped> first;
  const double voltage_v = sample.battery_voltage_v;
  const double least_v = least_voltage_share * nominal_v_, greatest_v = greatest_voltage_share * nominal_v_;
  if (!std::isnan(voltage_v) && !(voltage_v >= least_v && voltage_v <= greatest_v)) {
    sample.battery_voltage_v = sample.battery_current_a = signals::unmeasured;
    first = {"battery_voltage",
             fmt::format("battery_voltage is {:.4g} V; a pack of {:.4g} V nominal has {:.3g} to {:.3g} V",
                         voltage_v, nominal_v_, least_v, greatest_v)};
  }
  const auto [right, left] = sample.wheel_velocity_rad_s;
  if (std::isnan(right + left)) return first;
  const bool counts = sample.wheel_velocity_rad_s != wheels_rad_s_;
  wheels_rad_s_ = sample.wheel_velocity_rad_s;
  struct Channel {
    const char* name;
    double* reading;
    double motion;
  };
  const std::array<Channel, 6> channels{
      {{"battery_current", &sample.battery_current_a,
        0.5 * speed_share_s_ * (std::fabs(right) + std::fabs(left))},
       {"motor_voltage.right", sample.motor_voltage_v.data(), speed_share_s_ * right},
       {"motor_voltage.left", &sample.motor_voltage_v[1], speed_share_s_ * left},
       {"motor_current.right", sample.motor_current_a.data(), speed_share_s_ * right},
       {"motor_current.left", &sample.motor_current_a[1], speed_share_s_ * left},
       {"yaw_rate", &sample.yaw_rate_rad_s, turn_share_s_ * (right - left)}}};
  for (std::size_t k = 0; k < channels.size(); ++k) {
    const Channel& c = channels[k];
    if (means_no_reading(*c.reading)) {
      if (!first)
        first = {c.name, fmt::format("{} is {:.10g}, by which devices state that they have no reading",
                                     c.name, *c.reading)};
      *c.reading = signals::unmeasured;
    }
    if (std::isnan(*c.reading) || !frozen(runs_[k], *c.reading, c.motion, sample.utime_us, counts)) continue;
    if (!first)
      first = {c.name, fmt::format("{} is frozen at {:.4g} while the robot moves; before, it repeated a "
                                   "value for {} rows at most",
                                   c.name, *c.reading, runs_[k].usual_rows)};
    *c.reading = signals::unmeasured;
  }
  return first;
}

std::vector<DroppedReadings> drop_impossible(std::vector<Recording>& recordings,
                                             const robot::RobotModel& robot) {
  std::vector<DroppedReadings> all;
  ImpossibleReadings impossible(robot);
  for (Recording& recording : recordings)
    for (signals::Sample& sample : recording.samples) {
      auto dropped = impossible.drop(sample);
      if (!dropped) continue;
      auto at = std::ranges::find(all, dropped->channel, &DroppedReadings::channel);
      if (at == all.end())
        at = all.insert(all.end(), {std::move(dropped->channel), std::move(dropped->why), 0});
      ++at->samples;
    }
  return all;
}

}  // namespace joulecast::telemetry
