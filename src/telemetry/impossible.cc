#include "telemetry/impossible.h"

#include <fmt/format.h>

#include <algorithm>

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

// The stream is frozen if every reading repeats for as long while the robot moves. Motion explains that in
// simulations without noise: a reading has to turn back in this share of rows, as noise does in 2/3.
constexpr double noisy_share = 0.5;

// A reading beyond the robot file and more than this many times all before is none, however often it
// comes. As large ones that vary this often are a signal: in another unit, or of another robot.
// One that is this many times all others is none from its exact return on.
constexpr double outlying = 4, returning = 2;
constexpr int fewest_values = 3;

// With virtual robots copper is 12 % and braking 15 % too small at 4 Hz, 3.5 and 4 % at 10 Hz
// (for_operators.md).
constexpr double slow_rate_hz = 5;

}  // namespace

std::string slow_stream(double rate_hz) {
  if (!(rate_hz < slow_rate_hz)) return "";
  return fmt::format(
      "is a slow stream of {:.3g} Hz: currents between samples are not measured, so copper and braking are "
      "underestimated",
      rate_hz);
}

ImpossibleReadings::ImpossibleReadings(const robot::RobotModel& robot)
    : nominal_v_(robot.battery.nominal_voltage_v),
      speed_share_s_(robot.kinematics.wheel_radius_m / robot.limits.speed_m_s),
      turn_share_s_(robot.kinematics.wheel_radius_m /
                    (2 * robot.kinematics.half_track_m * robot.limits.yaw_rate_rad_s)),
      current_a_(robot.limits.current_a),
      yaw_rate_rad_s_(outlying * robot.limits.yaw_rate_rad_s) {
  row_.fill(signals::unmeasured);
}

bool ImpossibleReadings::Run::is_long() const {
  return runs >= fewest_runs && rows > frozen_runs * usual_rows;
}

void ImpossibleReadings::Run::begin(std::int64_t utime_us, bool counts, bool was_frozen) {
  if (rows > 0 && !was_frozen) {
    ++runs;
    usual_rows = std::max(usual_rows, rows);
  }
  begin_us = utime_us;
  rows = counts ? 1 : 0;
}

bool ImpossibleReadings::outlies(Channel& channel, double value, double limit) {
  const double size = std::fabs(value), ratio = value / channel.outlier;
  const double bound = channel.largest > 0 ? std::max(limit, outlying * channel.largest) : outlying * limit;
  const double near = std::max(limit, returning * channel.largest);
  if (size > near && size <= bound) {
    if (ratio == 1) return value != channel.value;
    const bool first = !(std::fabs(channel.outlier) > near);
    channel.outlier = value;
    if (first) return false;
  }
  if (!(size > bound)) {
    channel.largest = std::fmax(channel.largest, size);
    channel.outliers = 0;
    return false;
  }
  if (!(ratio < outlying && ratio * outlying > 1)) channel.outliers = 0;
  if (channel.outliers == 0 || ratio != 1) ++channel.outliers;
  channel.outlier = value;
  if (channel.outliers < fewest_values) return true;
  channel.largest = size;
  return false;
}

// `counts`: the row shows whether the channel follows the motion.
bool ImpossibleReadings::frozen(Channel& channel, double value, double motion, std::int64_t utime_us,
                                bool counts) {
  Run& run = channel.run;
  counts = counts || (value == 0 && std::fabs(motion) > least_varied);
  const auto is_frozen = [&] { return run.is_long() && channel.fastest - channel.slowest > least_varied; };
  if (value != channel.value) {
    run.begin(utime_us, counts, is_frozen());
    channel.value = value;
    channel.slowest = channel.fastest = value == 0 ? 0 : motion;  // 0 is read at rest
    return false;
  }
  run.rows += counts ? 1 : 0;
  channel.slowest = std::min(channel.slowest, motion);
  channel.fastest = std::max(channel.fastest, motion);
  return is_frozen() && utime_us - run.begin_us >= least_frozen_us;
}

bool ImpossibleReadings::frozen(const signals::Sample& sample, bool moves) {
  bool repeats = true, turns_back = false;
  for (std::size_t k = 0; const double* reading : signals::numbers_of(sample)) {
    double &last = row_[k], &last_step = steps_[k++];
    const double step = *reading - last;
    if (step == 0 || (std::isnan(*reading) && std::isnan(last))) continue;
    repeats = false;
    turns_back = turns_back || step * last_step < 0;
    last_step = step;
    last = *reading;
  }
  const auto is_frozen = [&] {
    return rows_.is_long() &&
           static_cast<double>(noisy_rows_) > noisy_share * static_cast<double>(rows_.runs);
  };
  if (!repeats) {
    rows_.begin(sample.utime_us, moves, is_frozen());
    noisy_rows_ += moves && turns_back ? 1 : 0;
    return false;
  }
  rows_.rows += moves ? 1 : 0;
  return is_frozen() && sample.utime_us - rows_.begin_us >= least_frozen_us;
}

std::optional<ImpossibleReadings::Dropped> ImpossibleReadings::drop(signals::Sample& sample) {
  std::optional<Dropped> first;
  const auto [right, left] = sample.wheel_velocity_rad_s;
  if (frozen(sample, right != 0 || left != 0)) {
    for (double* reading : signals::numbers_of(sample)) *reading = signals::unmeasured;
    return Dropped{"wheel_velocity",
                   fmt::format("every reading repeats while the robot moves: the stream is frozen; before, "
                               "rows repeated {} times at most",
                               rows_.usual_rows)};
  }
  const double voltage_v = sample.battery_voltage_v;
  const double least_v = least_voltage_share * nominal_v_, greatest_v = greatest_voltage_share * nominal_v_;
  if (!std::isnan(voltage_v) && !(voltage_v >= least_v && voltage_v <= greatest_v)) {
    sample.battery_voltage_v = sample.battery_current_a = signals::unmeasured;
    first = {"battery_voltage",
             fmt::format("battery_voltage is {:.4g} V; a pack of {:.4g} V nominal has {:.3g} to {:.3g} V",
                         voltage_v, nominal_v_, least_v, greatest_v)};
  }
  if (std::isnan(right + left)) return first;
  const bool counts = sample.wheel_velocity_rad_s != wheels_rad_s_;
  wheels_rad_s_ = sample.wheel_velocity_rad_s;
  struct Follower {
    const char* name;
    double* reading;
    double limit, motion;
    bool off = false;
  };
  // A motor that is off has neither voltage nor current, however its wheel turns: that is no error.
  const auto off = [&](std::size_t side) {
    return sample.motor_voltage_v[side] == 0 && sample.motor_current_a[side] == 0;
  };
  const std::array<Follower, 6> followers{
      {{"battery_current", &sample.battery_current_a, current_a_,
        0.5 * speed_share_s_ * (std::fabs(right) + std::fabs(left))},
       {"motor_voltage.right", sample.motor_voltage_v.data(), greatest_v, speed_share_s_ * right, off(0)},
       {"motor_voltage.left", &sample.motor_voltage_v[1], greatest_v, speed_share_s_ * left, off(1)},
       {"motor_current.right", sample.motor_current_a.data(), current_a_, speed_share_s_ * right, off(0)},
       {"motor_current.left", &sample.motor_current_a[1], current_a_, speed_share_s_ * left, off(1)},
       {"yaw_rate", &sample.yaw_rate_rad_s, yaw_rate_rad_s_, turn_share_s_ * (right - left)}}};
  for (std::size_t k = 0; k < followers.size(); ++k) {
    const Follower& f = followers[k];
    Channel& channel = channels_[k];
    if (std::isnan(*f.reading)) continue;
    std::string why;
    if (outlies(channel, *f.reading, f.limit))
      why = fmt::format("{} is {:.10g}; the largest before was {:.4g}, and the robot file allows {:.4g}",
                        f.name, *f.reading, channel.largest, f.limit);
    else if (frozen(channel, *f.reading, f.motion, sample.utime_us, counts))
      why = fmt::format(
          "{} is frozen at {:.4g} while the robot moves; before, it repeated a value for {} rows at most",
          f.name, *f.reading, channel.run.usual_rows);
    if (why.empty()) continue;
    if (!first && !f.off) first = {f.name, std::move(why)};
    *f.reading = signals::unmeasured;
  }
  return first;
}

std::vector<DroppedReadings> drop_impossible(std::vector<Recording>& recordings,
                                             const robot::RobotModel& robot) {
  std::vector<DroppedReadings> all;
  ImpossibleReadings impossible(robot);
  for (Recording& recording : recordings) {
    for (signals::Sample& sample : recording.samples) {
      auto dropped = impossible.drop(sample);
      if (!dropped) continue;
      auto at = std::ranges::find(all, dropped->channel, &DroppedReadings::channel);
      if (at == all.end())
        at = all.insert(all.end(), {std::move(dropped->channel), std::move(dropped->why), 0});
      ++at->samples;
    }
    std::erase_if(recording.samples, lacks_motion);
  }
  return all;
}

}  // namespace joulecast::telemetry
