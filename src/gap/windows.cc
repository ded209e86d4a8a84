#include "gap/windows.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "base/median.h"
#include "dynamics/parameters.h"
#include "telemetry/payload.h"

namespace joulecast::gap {
namespace {

using telemetry::Sample;

constexpr double moving_rad_s = 0.10;   // slowest wheel that surely turns
constexpr double resting_rad_s = 0.03;  // fastest wheel that surely stands
// Turned since it stood, from which on a wheel slides: before that dry friction builds up as contacts bend
// (Canudas de Wit and others 1995).
constexpr double sliding_rad = 0.1;
constexpr std::size_t block_windows = 50;

// One mission's channels as columns, with what needs every sample worked out.
struct Columns {
  std::vector<double> t;
  std::array<std::vector<double>, 2> speed, smooth_speed, voltage, current, power, power_abs, braking, angle,
      current_sign, slid;
  std::vector<double> battery_voltage, battery_current, battery_power, yaw_rate, x, y, heading, payload,
      charge;
  std::array<std::vector<double>, 2> copper;
  double battery_voltage_step_v = 0;
};

// Median distance between neighbouring values among readings that differ: the step of a coarse converter,
// next to nothing for a fine one.
double step_of(std::vector<double> readings) {
  std::erase_if(readings, [](double v) { return !std::isfinite(v); });
  std::ranges::sort(readings);
  std::vector<double> steps;
  for (std::size_t k = 1; k < readings.size(); ++k) {
    if (readings[k] > readings[k - 1]) steps.push_back(readings[k] - readings[k - 1]);
  }
  return steps.empty() ? 0 : upper_median(std::move(steps));
}

// Centred mean over samples within +-half_s.
std::vector<double> smoothed(const std::vector<double>& t, const std::vector<double>& v, double half_s) {
  std::vector<double> out(v.size());
  std::size_t low = 0, high = 0;
  double sum = 0;
  for (std::size_t k = 0; k < v.size(); ++k) {
    while (high < v.size() && t[high] <= t[k] + half_s + 1e-9) sum += v[high++];
    while (t[low] < t[k] - half_s - 1e-9) sum -= v[low++];
    out[k] = sum / static_cast<double>(high - low);
  }
  return out;
}

// v(t + shift), linear between samples.
std::vector<double> shifted(const std::vector<double>& t, const std::vector<double>& v, double shift_s) {
  std::vector<double> out(v.size());
  std::size_t k = 0;
  for (std::size_t n = 0; n < v.size(); ++n) {
    const double at = t[n] + shift_s;
    while (k + 2 < t.size() && t[k + 1] < at) ++k;
    while (k > 0 && t[k] > at) --k;
    const double part = std::clamp((at - t[k]) / (t[k + 1] - t[k]), 0.0, 1.0);
    out[n] = v[k] + part * (v[k + 1] - v[k]);
  }
  return out;
}

Columns columns_of(const telemetry::Recording& mission, const robot::RobotModel& robot, double period_s,
                   const WindowSettings& settings) {
  const double delay_s = settings.electrical_delay_s;
  const std::size_t n = mission.samples.size();
  Columns c;
  const auto fill = [&](std::vector<double>& column, auto&& get) {
    column.reserve(n);
    for (const Sample& s : mission.samples) column.push_back(get(s));
  };
  const std::int64_t start = mission.samples.front().utime_us;
  fill(c.t, [&](const Sample& s) { return 1e-6 * static_cast<double>(s.utime_us - start); });
  const auto electrical = [&](std::vector<double>& column, auto&& get) {
    fill(column, get);
    if (delay_s != 0) column = shifted(c.t, column, delay_s);
  };
  const double smooth_s = 2.2 * period_s;
  for (std::size_t s : {0u, 1u}) {
    fill(c.speed[s], [s](const Sample& x) { return x.wheel_velocity_rad_s[s]; });
    c.smooth_speed[s] = smoothed(c.t, c.speed[s], smooth_s);
    electrical(c.voltage[s], [s](const Sample& x) { return x.motor_voltage_v[s]; });
    electrical(c.current[s], [s](const Sample& x) { return x.motor_current_a[s]; });
    const std::vector<double> volts = smoothed(c.t, c.voltage[s], smooth_s);
    const std::vector<double> amps = smoothed(c.t, c.current[s], smooth_s);
    c.power[s].resize(n);
    c.power_abs[s].resize(n);
    c.braking[s].resize(n);
    c.current_sign[s].resize(n);
    const double soft_a = 0.1 * robot.motor.friction_torque_nm[s] /
                              (robot.motor.torque_constant_nm_a * robot.motor.gear_ratio) +
                          dynamics::brush_width_a;
    c.copper[s].resize(n);
    c.angle[s].resize(n);
    c.slid[s].resize(n);
    for (std::size_t k = 0; k < n; ++k) {
      c.power[s][k] = c.voltage[s][k] * c.current[s][k];
      const double power = volts[k] * amps[k];
      c.power_abs[s][k] = std::fabs(power);
      c.braking[s][k] = std::max(0.0, -power);
      c.current_sign[s][k] =
          std::isfinite(amps[k]) ? std::tanh((amps[k] - settings.motor_current_bias_a) / soft_a) : 0.0;
      double current = amps[k];
      if (!std::isfinite(current)) {
        // No motor current: the nominal friction current heats the winding.
        const double speed = c.smooth_speed[s][k];
        current = std::fabs(speed) > resting_rad_s
                      ? robot.motor.friction_torque_nm[s] /
                            (robot.motor.torque_constant_nm_a * robot.motor.gear_ratio)
                      : 0.0;
      }
      c.copper[s][k] = robot.motor.resistance_ohm * current * current;
      const double step = k == 0 ? 0.0 : c.t[k] - c.t[k - 1];
      c.angle[s][k] = k == 0 ? 0.0 : c.angle[s][k - 1] + 0.5 * step * (c.speed[s][k] + c.speed[s][k - 1]);
      const double speed = c.smooth_speed[s][k];
      const bool stands = std::fabs(speed) < resting_rad_s || (k > 0 && speed * c.smooth_speed[s][k - 1] < 0);
      // A recording that begins on the way slides from its beginning.
      c.slid[s][k] = stands ? 0.0 : k == 0 ? sliding_rad : c.slid[s][k - 1] + std::fabs(speed) * step;
    }
  }
  electrical(c.battery_voltage, [](const Sample& s) { return s.battery_voltage_v; });
  electrical(c.battery_current, [](const Sample& s) { return s.battery_current_a; });
  c.battery_voltage_step_v = step_of(c.battery_voltage);
  c.battery_power.resize(n);
  c.charge.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    c.battery_power[k] = c.battery_voltage[k] * c.battery_current[k];
    const double amps = std::isfinite(c.battery_current[k]) ? c.battery_current[k] : 0.0;
    c.charge[k] = k == 0 ? 0.0 : c.charge[k - 1] + amps * (c.t[k] - c.t[k - 1]);
  }
  fill(c.yaw_rate, [](const Sample& s) { return s.yaw_rate_rad_s; });
  fill(c.x, [](const Sample& s) { return s.pose[0]; });
  fill(c.y, [](const Sample& s) { return s.pose[1]; });
  c.heading.reserve(n);
  for (const Sample& s : mission.samples) {
    const double h = s.pose[2];
    // Unwound: map headings may jump by a turn.
    const double last = c.heading.empty() ? missing : c.heading.back();
    c.heading.push_back(
        std::isfinite(last) && std::isfinite(h) ? last + std::remainder(h - last, 2 * std::numbers::pi) : h);
  }
  telemetry::MissionPayload payload(mission.payload_kg);
  fill(c.payload, [&](const Sample& s) {
    const double kg = payload.take(s.payload_kg);
    return std::isfinite(kg) ? kg : 0.0;
  });
  return c;
}

double median_period(const telemetry::Recording& mission) {
  std::vector<double> steps;
  steps.reserve(mission.samples.size());
  for (std::size_t k = 1; k < mission.samples.size(); ++k) {
    steps.push_back(1e-6 *
                    static_cast<double>(mission.samples[k].utime_us - mission.samples[k - 1].utime_us));
  }
  return upper_median(std::move(steps));
}

// What the past leaves at every sample.
struct Memory {
  // Copper heat and speed, low-passed on every time constant.
  std::array<std::array<std::vector<double>, 2>, heat_time_constants_s.size()> heat;
  std::array<std::vector<double>, motion_time_constants_s.size()> motion;
};

// From nothing at the mission's start.
template <class Value>
std::vector<double> low_passed(const std::vector<double>& t, double time_constant_s, const Value& value) {
  std::vector<double> out(t.size());
  double state = 0;
  for (std::size_t k = 0; k < out.size(); ++k) {
    const double step = k == 0 ? 0.0 : t[k] - t[k - 1];
    state += (value(k) - state) * (1 - std::exp(-step / time_constant_s));
    out[k] = state;
  }
  return out;
}

Memory memory_of(const Columns& c) {
  Memory memory;
  for (std::size_t q = 0; q < memory.heat.size(); ++q) {
    for (std::size_t s : {0u, 1u}) {
      memory.heat[q][s] =
          low_passed(c.t, heat_time_constants_s[q], [&](std::size_t k) { return c.copper[s][k]; });
    }
  }
  for (std::size_t q = 0; q < memory.motion.size(); ++q) {
    memory.motion[q] = low_passed(c.t, motion_time_constants_s[q], [&](std::size_t k) {
      return 0.5 * (std::fabs(c.smooth_speed[0][k]) + std::fabs(c.smooth_speed[1][k]));
    });
  }
  return memory;
}

// Mean of a column within +-half_s of an instant.
double mean_near(const Columns& c, const std::vector<double>& v, double t, double half_s) {
  auto k = static_cast<std::size_t>(std::ranges::lower_bound(c.t, t - half_s) - c.t.begin());
  double sum = 0;
  std::size_t count = 0;
  for (; k < c.t.size() && c.t[k] <= t + half_s; ++k, ++count) sum += v[k];
  return count > 0 ? sum / static_cast<double>(count) : missing;
}

void add_span(const Columns& c, const WindowSettings& settings, const robot::RobotModel& robot, Window& w) {
  const double from = w.t_s, to = w.t_s + settings.span_s, half = 0.1;
  if (to + half > c.t.back() || from - half < c.t.front()) return;
  const double dx = mean_near(c, c.x, to, half) - mean_near(c, c.x, from, half);
  const double dy = mean_near(c, c.y, to, half) - mean_near(c, c.y, from, half);
  const double turn = mean_near(c, c.heading, to, half) - mean_near(c, c.heading, from, half);
  for (std::size_t s : {0u, 1u}) {
    w.span_angle_rad[s] = mean_near(c, c.angle[s], to, half) - mean_near(c, c.angle[s], from, half);
  }
  w.turn_rad = turn;
  if (!std::isfinite(dx + dy + turn)) return;
  double east = 0, north = 0, length = 0, previous = from;
  for (auto k = static_cast<std::size_t>(std::ranges::lower_bound(c.t, from) - c.t.begin());
       k < c.t.size() && c.t[k] <= to; ++k) {
    const double ds =
        robot.kinematics.wheel_radius_m * 0.5 * (c.speed[0][k] + c.speed[1][k]) * (c.t[k] - previous);
    previous = c.t[k];
    east += ds * std::cos(c.heading[k]);
    north += ds * std::sin(c.heading[k]);
    length += ds;
  }
  const double chord = std::hypot(east, north);
  if (std::fabs(length) < 0.05 || chord < 0.7 * std::fabs(length)) return;
  const double way = length > 0 ? 1.0 : -1.0;
  w.forward_m = way * (dx * east + dy * north) / chord;
  w.chord = chord / std::fabs(length);
}

class Shape {  // one window's weights
 public:
  Shape(const Columns& c, std::size_t first, std::size_t last, double centre, double length) : first_(first) {
    weight_.resize(last - first);
    slope_.resize(last - first);
    double total = 0, mean_slope = 0;
    for (std::size_t k = first; k < last; ++k) {
      const double before = k > 0 ? c.t[k] - c.t[k - 1] : c.t[k + 1] - c.t[k];
      const double after = k + 1 < c.t.size() ? c.t[k + 1] - c.t[k] : before;
      const double cell = 0.5 * (std::min(before, length) + std::min(after, length));
      const double u = 2 * std::numbers::pi * (c.t[k] - centre) / length;
      weight_[k - first] = cell * (1 + std::cos(u));
      slope_[k - first] = cell * std::sin(u);
      total += weight_[k - first];
      mean_slope += slope_[k - first];
    }
    for (double& w : weight_) w /= total;
    for (std::size_t k = first; k < last; ++k) {
      const double third = 3 * (c.t[k] - centre) / length;
      part_.push_back(third < -0.5 ? 0 : third > 0.5 ? 2 : 1);
      part_weight_[part_.back()] += weight_[k - first];
    }
    // The slope's weights see no constant and have gain one on a straight line.
    double gain = 0;
    for (std::size_t k = 0; k < weight_.size(); ++k) {
      slope_[k] -= mean_slope * weight_[k];
      gain += slope_[k] * (c.t[first + k] - centre);
    }
    for (double& s : slope_) s /= gain;
  }
  double mean(const std::vector<double>& v) const { return sum(weight_, v); }
  // Of the samples in the window's begin, middle and end; 0 where there are none.
  const std::array<double, 3>& part_weight() const { return part_weight_; }
  double mean_of_part(std::size_t part, const std::vector<double>& v) const {
    double total = 0;
    for (std::size_t k = 0; k < weight_.size(); ++k) {
      if (part_[k] == part) total += weight_[k] * v[first_ + k];
    }
    return part_weight_[part] > 0 ? total / part_weight_[part] : 0;
  }
  double slope(const std::vector<double>& v) const { return sum(slope_, v); }

 private:
  double sum(const std::vector<double>& weights, const std::vector<double>& v) const {
    double total = 0;
    for (std::size_t k = 0; k < weights.size(); ++k) total += weights[k] * v[first_ + k];
    return total;
  }
  std::size_t first_;
  std::vector<double> weight_, slope_;
  std::vector<std::size_t> part_;  // of each sample
  std::array<double, 3> part_weight_{};
};

Window window_at(const Columns& c, const Memory& memory, std::size_t first, std::size_t last, double centre,
                 double length) {
  const Shape shape(c, first, last, centre, length);
  Window w;
  w.t_s = centre;
  w.part_weight = shape.part_weight();
  w.payload_kg = shape.mean(c.payload);
  for (std::size_t s : {0u, 1u}) {
    w.speed_rad_s[s] = shape.mean(c.speed[s]);
    w.acceleration_rad_s2[s] = shape.slope(c.speed[s]);
    for (std::size_t part = 0; part < w.part_weight.size(); ++part)
      w.part_speed_rad_s[part][s] = shape.mean_of_part(part, c.speed[s]);
    double slowest = std::numeric_limits<double>::infinity(), fastest = 0;
    bool forward = false, backward = false, slides = true;
    for (std::size_t k = first; k < last; ++k) {
      const double speed = c.smooth_speed[s][k];
      slides = slides && c.slid[s][k] >= sliding_rad;
      slowest = std::min(slowest, std::fabs(speed));
      fastest = std::max(fastest, std::fabs(speed));
      (speed > 0 ? forward : backward) = true;
    }
    w.moving[s] = slowest > moving_rad_s && !(forward && backward) && slides;
    w.resting[s] = fastest < resting_rad_s;
    w.voltage_v[s] = shape.mean(c.voltage[s]);
    w.current_a[s] = shape.mean(c.current[s]);
    w.voltage_slope_v_s[s] = shape.slope(c.voltage[s]);
    w.current_slope_a_s[s] = shape.slope(c.current[s]);
    w.motor_power_w[s] = shape.mean(c.power[s]);
    w.motor_power_abs_w[s] = shape.mean(c.power_abs[s]);
    w.braking_w[s] = shape.mean(c.braking[s]);
    // At rest the reading is noise about nothing.
    w.current_sign[s] = w.resting[s] ? 0.0 : shape.mean(c.current_sign[s]);
    for (std::size_t q = 0; q < memory.heat.size(); ++q)
      w.copper_heat_w[q][s] = shape.mean(memory.heat[q][s]);
  }
  for (std::size_t q = 0; q < memory.motion.size(); ++q) w.recent_rad_s[q] = shape.mean(memory.motion[q]);
  w.battery_voltage_v = shape.mean(c.battery_voltage);
  w.battery_voltage_step_v = c.battery_voltage_step_v;
  w.battery_current_a = shape.mean(c.battery_current);
  w.battery_power_w = shape.mean(c.battery_power);
  w.battery_power_slope_w_s = shape.slope(c.battery_power);
  w.battery_current_slope_a_s = shape.slope(c.battery_current);
  w.charge_as = shape.mean(c.charge);
  w.yaw_rate_rad_s = shape.mean(c.yaw_rate);
  w.x_m = shape.mean(c.x);
  w.y_m = shape.mean(c.y);
  w.heading_rad = shape.mean(c.heading);
  return w;
}

}  // namespace

void take_out(const dynamics::ActiveEffect& effect, WindowSettings& settings) {
  const std::string_view id = effect.effect->info().id;
  if (id == "sensor_delay") settings.electrical_delay_s = effect.values[0];
  if (id == "current_sensor_bias") settings.motor_current_bias_a = effect.values[0] * effect.values[1];
}

std::vector<Window> make_windows(const RecordingSet& set, const robot::RobotModel& robot,
                                 const WindowSettings& settings) {
  double total_s = 0;
  for (const auto& mission : set.missions) {
    total_s += 1e-6 * static_cast<double>(mission.samples.back().utime_us - mission.samples.front().utime_us);
  }
  const double expected = 2 * total_s / settings.length_s;
  const auto keep_every = static_cast<std::size_t>(
      std::max(1.0, std::ceil(expected / static_cast<double>(settings.most_windows))));

  std::vector<Window> windows;
  std::size_t position = 0;  // of a window among all, kept or not
  for (std::size_t m = 0; m < set.missions.size(); ++m) {
    const double period = median_period(set.missions[m]);
    const double length = std::max(settings.length_s, static_cast<double>(settings.fewest_samples) * period);
    const double longest_gap = std::max(settings.longest_gap_s, 2.5 * period);
    const Columns c = columns_of(set.missions[m], robot, period, settings);
    const Memory memory = memory_of(c);
    const double hop = 0.5 * length;
    const auto windows_a_span = static_cast<std::size_t>(std::max(1.0, std::round(settings.span_s / hop)));
    std::size_t first = 0;
    bool continues = false;
    const auto count = static_cast<std::size_t>((c.t.back() - length) / hop) + 1;
    for (std::size_t k = 0; k < count; ++k) {
      const double from = static_cast<double>(k) * hop;
      while (first < c.t.size() && c.t[first] < from) ++first;
      if (position++ / block_windows % keep_every != 0) {
        continues = false;
        continue;
      }
      std::size_t last = first;
      double gap = c.t[first] - from;
      while (last < c.t.size() && c.t[last] <= from + length + 1e-9) {
        if (last > first) gap = std::max(gap, c.t[last] - c.t[last - 1]);
        ++last;
      }
      if (last - first < settings.fewest_samples / 2 || gap > longest_gap) {
        continues = false;
        continue;
      }
      Window w = window_at(c, memory, first, last, from + 0.5 * length, length);
      w.mission = m;
      w.electrical_shift_s = settings.electrical_delay_s;
      w.continues = continues;
      if (k % windows_a_span == 0) add_span(c, settings, robot, w);
      windows.push_back(w);
      continues = true;
    }
  }
  if (set.missions.size() == 1) {
    const double length_s = windows.empty() ? 1.0 : windows.back().t_s + 1e-6;
    for (std::size_t k = 0; k < windows.size(); ++k) {
      windows[k].mission = static_cast<std::size_t>(single_mission_parts * windows[k].t_s / length_s);
      if (k > 0 && windows[k].mission != windows[k - 1].mission) windows[k].continues = false;
    }
  }
  return windows;
}

}  // namespace joulecast::gap
