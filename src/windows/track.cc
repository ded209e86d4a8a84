#include "windows/track.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamics/parameters.h"
#include "statistics/robust.h"

namespace joulecast::windows {
namespace {

using signals::Sample;

double mean_of_known(const std::vector<double>& v) {
  double sum = 0, known = 0;
  for (const double value : v)
    if (std::isfinite(value)) sum += value, ++known;
  return known > 0 ? sum / known : missing;
}

// Centred mean over the measured samples within +-half_s; NaN without such samples.
std::vector<double> smoothed(const std::vector<double>& t, const std::vector<double>& v, double half_s) {
  std::vector<double> out(v.size());
  std::size_t low = 0, high = 0, known = 0;
  double sum = 0;
  for (std::size_t k = 0; k < v.size(); ++k) {
    for (; high < v.size() && t[high] <= t[k] + half_s + 1e-9; ++high)
      if (std::isfinite(v[high])) sum += v[high], ++known;
    for (; t[low] < t[k] - half_s - 1e-9; ++low)
      if (std::isfinite(v[low])) sum -= v[low], --known;
    out[k] = known > 0 ? sum / static_cast<double>(known) : missing;
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

class Builder {
 public:
  Builder(const telemetry::Recording& mission, const robot::RobotModel& robot,
          std::span<const std::string> covariates, double period_s, const WindowSettings& settings)
      : mission_(mission),
        robot_(robot),
        covariates_(covariates),
        settings_(settings),
        smooth_s_(2.2 * period_s) {}

  Track build() {
    const std::int64_t start = mission_.samples.front().utime_us;
    track_.time_s = column([&](const Sample& s) { return 1e-6 * static_cast<double>(s.utime_us - start); });
    std::array<std::vector<double>, 2> copper_w;
    track_.inductance_h = robot_.motor.inductance_h;
    for (const std::size_t side : {0u, 1u}) add_side(side, copper_w[side]);
    add_battery();
    add_pose();
    add_payload();
    add_covariates();
    add_memory(copper_w);
    return std::move(track_);
  }

 private:
  template <class Get>
  std::vector<double> column(const Get& get) const {
    std::vector<double> values(mission_.samples.size());
    std::ranges::transform(mission_.samples, values.begin(), get);
    return values;
  }
  template <class Get>
  std::vector<double> electrical(const Get& get) const {
    std::vector<double> values = column(get);
    return settings_.electrical_delay_s == 0 ? values
                                             : shifted(track_.time_s, values, settings_.electrical_delay_s);
  }
  double friction_current_a(std::size_t s) const {
    return robot_.motor.friction_torque_nm[s] / (robot_.motor.torque_constant_nm_a * robot_.motor.gear_ratio);
  }

  void add_side(std::size_t s, std::vector<double>& copper_w) {
    Track& c = track_;
    const std::size_t n = mission_.samples.size();
    c.speed[s] = column([s](const Sample& x) { return x.wheel_velocity_rad_s[s]; });
    c.smooth_speed[s] = smoothed(c.time_s, c.speed[s], smooth_s_);
    if (settings_.half) c.speed[s] = half_of(c.time_s, std::move(c.speed[s]), *settings_.half);
    c.voltage[s] = electrical([s](const Sample& x) { return x.motor_voltage_v[s]; });
    c.current[s] = electrical([s](const Sample& x) { return x.motor_current_a[s]; });
    const std::vector<double> volts = smoothed(c.time_s, c.voltage[s], smooth_s_);
    const std::vector<double> amps = smoothed(c.time_s, c.current[s], smooth_s_);
    for (auto* values :
         {&c.power[s], &c.power_abs[s], &c.braking[s], &c.current_sign[s], &c.angle[s], &c.slid[s]})
      values->resize(n);
    copper_w.resize(n);
    const double soft_a = 0.1 * friction_current_a(s) + dynamics::brush_width_a;
    for (std::size_t k = 0; k < n; ++k) {
      const double speed = c.smooth_speed[s][k], power = volts[k] * amps[k];
      c.power[s][k] = c.voltage[s][k] * c.current[s][k];
      c.power_abs[s][k] = std::fabs(power);
      c.braking[s][k] = std::max(0.0, -power);
      const bool known = std::isfinite(amps[k]);
      c.current_sign[s][k] = known ? std::tanh(amps[k] / soft_a) : 0.0;
      // Where the motor's current is not measured, the nominal friction's heats the winding.
      const double heating_a = known                              ? amps[k]
                               : std::fabs(speed) > resting_rad_s ? friction_current_a(s)
                                                                  : 0.0;
      copper_w[k] = robot_.motor.resistance_ohm * heating_a * heating_a;
      const double step = k == 0 ? 0.0 : c.time_s[k] - c.time_s[k - 1];
      c.angle[s][k] = k == 0 ? 0.0 : c.angle[s][k - 1] + 0.5 * step * (c.speed[s][k] + c.speed[s][k - 1]);
      const bool stands = std::fabs(speed) < resting_rad_s || (k > 0 && speed * c.smooth_speed[s][k - 1] < 0);
      // A recording that begins on the way slides from its beginning.
      c.slid[s][k] = stands ? 0.0 : k == 0 ? sliding_rad : c.slid[s][k - 1] + std::fabs(speed) * step;
    }
  }

  void add_battery() {
    Track& c = track_;
    const std::size_t n = mission_.samples.size();
    c.battery_voltage = electrical([](const Sample& s) { return s.battery_voltage_v; });
    c.battery_current = electrical([](const Sample& s) { return s.battery_current_a; });
    c.mean_battery_voltage_v = mean_of_known(c.battery_voltage);
    c.battery_power.resize(n);
    c.charge.resize(n);
    for (std::size_t k = 0; k < n; ++k) {
      c.battery_power[k] = c.battery_voltage[k] * c.battery_current[k];
      const double amps = std::isfinite(c.battery_current[k]) ? c.battery_current[k] : 0.0;
      c.charge[k] = k == 0 ? 0.0 : c.charge[k - 1] + amps * (c.time_s[k] - c.time_s[k - 1]);
    }
  }

  void add_pose() {
    Track& c = track_;
    c.yaw_rate = column([](const Sample& s) { return s.yaw_rate_rad_s; });
    c.climb = telemetry::climb_of(mission_, dynamics::nominal_parameters<double>(robot_));
    c.x = column([](const Sample& s) { return s.pose[0]; });
    c.y = column([](const Sample& s) { return s.pose[1]; });
    for (const Sample& s : mission_.samples) {
      // Unwound: map headings may jump by a turn.
      const double h = s.pose[2], last = c.heading.empty() ? missing : c.heading.back();
      c.heading.push_back(std::isfinite(last + h) ? last + std::remainder(h - last, 2 * std::numbers::pi)
                                                  : h);
    }
  }

  void add_payload() {
    telemetry::MissionPayload payload(mission_.payload_kg);
    track_.payload = column([&](const Sample& s) {
      const double kg = payload.take(s.payload_kg);
      return std::isfinite(kg) ? kg : 0.0;
    });
  }

  void add_covariates() {
    for (const std::string& name : covariates_) {
      signals::CovariateReader reader(signals::find_series(mission_.covariates, name));
      track_.covariates.push_back(column([&](const Sample& s) { return reader.at(s.utime_us); }));
    }
  }

  void add_memory(const std::array<std::vector<double>, 2>& copper_w) {
    Track& c = track_;
    for (std::size_t q = 0; q < c.heat.size(); ++q) {
      for (const std::size_t s : {0u, 1u})
        c.heat[q][s] =
            low_passed(c.time_s, heat_time_constants_s[q], [&](std::size_t k) { return copper_w[s][k]; });
    }
    for (std::size_t q = 0; q < c.motion.size(); ++q) {
      c.motion[q] = low_passed(c.time_s, motion_time_constants_s[q], [&](std::size_t k) {
        return 0.5 * (std::fabs(c.smooth_speed[0][k]) + std::fabs(c.smooth_speed[1][k]));
      });
    }
  }

  const telemetry::Recording& mission_;
  const robot::RobotModel& robot_;
  std::span<const std::string> covariates_;
  const WindowSettings& settings_;
  double smooth_s_;
  Track track_;
};

}  // namespace

Line line_at(std::span<const double> time_s, std::span<const double> v, double at_s, double half_s,
             double fewest) {
  double n = 0, t = 0, tt = 0, y = 0, ty = 0;
  auto k = static_cast<std::size_t>(std::ranges::lower_bound(time_s, at_s - half_s - 1e-9) - time_s.begin());
  for (; k < time_s.size() && time_s[k] <= at_s + half_s + 1e-9; ++k) {
    if (!std::isfinite(v[k])) continue;
    const double u = time_s[k] - at_s;
    ++n, t += u, tt += u * u, y += v[k], ty += u * v[k];
  }
  const double spread = n * tt - t * t;
  if (n < fewest || !(spread > 0)) return {};
  const double slope = (n * ty - t * y) / spread;
  return {(y - slope * t) / n, slope};
}

std::vector<double> half_of(std::span<const double> time_s, std::vector<double> v, std::size_t first) {
  for (std::size_t k = first + 1; k + 1 < v.size(); k += 2) {
    const double part = (time_s[k] - time_s[k - 1]) / (time_s[k + 1] - time_s[k - 1]);
    const double between = std::lerp(v[k - 1], v[k + 1], part);
    if (std::isfinite(v[k] + between)) v[k] = between;
  }
  return v;
}

double median_period_s(const telemetry::Recording& mission) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < mission.samples.size(); ++k)
    steps.push_back(1e-6 *
                    static_cast<double>(mission.samples[k].utime_us - mission.samples[k - 1].utime_us));
  return statistics::median(std::move(steps));
}

Track make_track(const telemetry::Recording& mission, const robot::RobotModel& robot,
                 std::span<const std::string> covariates, double period_s, const WindowSettings& settings) {
  return Builder(mission, robot, covariates, period_s, settings).build();
}

Kernel::Kernel(std::span<const double> time_s, std::size_t first, std::size_t last, double centre_s,
               double length_s)
    : first_(first), weight_(last - first), slope_(last - first) {
  double total = 0, mean_slope = 0;
  for (std::size_t k = first; k < last; ++k) {
    const double before = k > 0 ? time_s[k] - time_s[k - 1] : time_s[k + 1] - time_s[k];
    const double after = k + 1 < time_s.size() ? time_s[k + 1] - time_s[k] : before;
    const double cell = 0.5 * (std::min(before, length_s) + std::min(after, length_s));
    const double u = 2 * std::numbers::pi * (time_s[k] - centre_s) / length_s;
    weight_[k - first] = cell * (1 + std::cos(u));
    slope_[k - first] = cell * std::sin(u);
    total += weight_[k - first];
    mean_slope += slope_[k - first];
  }
  for (double& w : weight_) w /= total;
  double gain = 0;
  for (std::size_t k = first; k < last; ++k) {
    const double third = 3 * (time_s[k] - centre_s) / length_s;
    part_.push_back(third < -0.5 ? 0 : third > 0.5 ? 2 : 1);
    part_weight_[part_.back()] += weight_[k - first];
    slope_[k - first] -= mean_slope * weight_[k - first];
    gain += slope_[k - first] * (time_s[k] - centre_s);
  }
  for (double& s : slope_) s /= gain;
}

double Kernel::mean_of_part(std::size_t part, std::span<const double> v) const {
  double total = 0;
  for (std::size_t k = 0; k < weight_.size(); ++k)
    if (part_[k] == part) total += weight_[k] * v[first_ + k];
  return part_weight_[part] > 0 ? total / part_weight_[part] : 0;
}

double Kernel::sum(const std::vector<double>& weights, std::span<const double> v) const {
  double total = 0;
  for (std::size_t k = 0; k < weights.size(); ++k) total += weights[k] * v[first_ + k];
  return total;
}

}  // namespace joulecast::windows
