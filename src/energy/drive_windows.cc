#include "energy/drive_windows.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace joulecast::energy {
namespace {

constexpr double microseconds = 1e-6;
constexpr double window_s = 0.4;
constexpr std::size_t fewest_samples = 8;  // in a window; sparse recordings get longer ones
constexpr double longest_gap_s = 0.3;
constexpr double moving_share = 0.03;         // of the fastest wheel speed: slower wheels may stick
constexpr double resting_rad_s = 0.03;        // encoders of a standing wheel show less
constexpr std::size_t most_equations = 6000;  // half an hour of driving

constexpr std::size_t index(Unknown unknown) {
  return static_cast<std::size_t>(unknown);
}

// Changes a robot by `step` in one unknown.
robot::RobotModel varied(robot::RobotModel robot, Unknown unknown, double step) {
  const auto effect = [&](const char* id, std::vector<std::pair<std::string, double>> parameters) {
    robot.effects.push_back({id, std::move(parameters)});
  };
  switch (unknown) {
    case Unknown::friction_right:
      robot.motor.friction_torque_nm[robot::right] += step;
      break;
    case Unknown::friction_left:
      robot.motor.friction_torque_nm[robot::left] += step;
      break;
    case Unknown::viscous:
      robot.motor.viscous_friction_nm_s_rad += step;
      break;
    case Unknown::idle_power:
      robot.idle_power_w += step;
      break;
    case Unknown::mass:
      robot.mass.chassis_kg += step;
      break;
    case Unknown::slope_cos:
      effect("slope", {{"angle_rad", step}, {"uphill_rad", 0}});
      break;
    case Unknown::slope_sin:
      effect("slope", {{"angle_rad", step}, {"uphill_rad", std::numbers::pi / 2}});
      break;
    case Unknown::scrub:
      effect("turning_scrub", {{"coefficient", step}});
      break;
    case Unknown::yaw_inertia:
      effect("yaw_inertia_error", {{"ratio", step}});
      break;
    case Unknown::payload:
    case Unknown::current_bias:
    case Unknown::driver_loss:
      break;
  }
  return robot;
}

}  // namespace

Result<DriveWindows> DriveWindows::make(const robot::RobotModel& robot) {
  auto model = dynamics::drive_model(robot);
  if (!model) return tl::unexpected(std::move(model.error()));
  DriveWindows windows(robot, std::move(*model));
  const std::pair<Unknown, double> steps[] = {{Unknown::friction_right, 0.01},
                                              {Unknown::friction_left, 0.01},
                                              {Unknown::viscous, 1e-3},
                                              {Unknown::idle_power, 1},
                                              {Unknown::mass, 0.01 * robot.mass.chassis_kg},
                                              {Unknown::slope_cos, 1e-3},
                                              {Unknown::slope_sin, 1e-3},
                                              {Unknown::scrub, 1e-2},
                                              {Unknown::yaw_inertia, 1e-2}};
  for (const auto& [unknown, step] : steps) {
    auto changed = dynamics::drive_model(varied(robot, unknown, step));
    if (!changed) return tl::unexpected(std::move(changed.error()));
    windows.varied_.push_back({index(unknown), step, std::move(*changed)});
  }
  return windows;
}

DriveWindows::DriveWindows(const robot::RobotModel& robot, dynamics::DriveModel model)
    : model_(std::move(model)),
      torque_per_a_(model_.parameters().torque_constant_nm_a),
      moving_rad_s_(moving_share * robot.limits.speed_m_s / robot.kinematics.wheel_radius_m) {}

std::vector<DriveEquation> DriveWindows::take() {
  payload_sum_kg_ = windows_ = last_payload_kg_ = 0;
  return std::exchange(equations_, {});
}

void DriveWindows::add(const telemetry::Sample& sample, double climb_rad) {
  if (!buffer_.empty()) {
    const double interval_s =
        static_cast<double>(sample.utime_us - buffer_.back().sample.utime_us) * microseconds;
    if (!(interval_s > 0) || interval_s > longest_gap_s) buffer_.clear();
  }
  buffer_.push_back({sample, climb_rad});
  if (std::isfinite(sample.payload_kg)) last_payload_kg_ = sample.payload_kg;
  const double span_s = static_cast<double>(sample.utime_us - buffer_.front().sample.utime_us) * microseconds;
  if (span_s < window_s || buffer_.size() < fewest_samples) return;
  close_window(buffer_.size());
  // The next window begins in the middle of this one.
  const double half_us = 0.5 * span_s / microseconds;
  const std::int64_t begun_us = buffer_.front().sample.utime_us;
  while (static_cast<double>(buffer_.front().sample.utime_us - begun_us) < half_us) buffer_.pop_front();
}

void DriveWindows::close_window(std::size_t count) {
  if (equations_.size() >= most_equations) return;
  const auto time_s = [&](std::size_t k) {
    return static_cast<double>(buffer_[k].sample.utime_us - buffer_.front().sample.utime_us) * microseconds;
  };
  const double length_s = time_s(count - 1);
  std::array<double, 2> speed{}, current{}, least{1e9, 1e9}, greatest{-1e9, -1e9};
  std::array<double, 2> slope_speed{};
  double slope_sum = 0, slope_time = 0, middle_s = 0, climb = 0;
  double weight = 0, battery_w = 0, motors_w = 0, motors_abs_w = 0, battery_beside_w = 0;
  bool motors = true, battery = true, same_payload = true;
  for (std::size_t k = 0; k < count; ++k) {
    const telemetry::Sample& s = buffer_[k].sample;
    // The window 1 - cos(2 pi t / T), by the trapezoid rule over uneven samples.
    const double before = k > 0 ? time_s(k) - time_s(k - 1) : 0,
                 after = k + 1 < count ? time_s(k + 1) - time_s(k) : 0;
    const double phase = 2 * std::numbers::pi * time_s(k) / length_s;
    const double w = 0.5 * (before + after) * (1 - std::cos(phase));
    const double slope = 0.5 * (before + after) * 2 * std::numbers::pi / length_s * std::sin(phase);
    weight += w;
    climb += w * buffer_[k].climb_rad;
    middle_s += w * time_s(k);
    slope_sum += slope;
    slope_time += slope * time_s(k);
    for (std::size_t side : {0u, 1u}) {
      const double rate = s.wheel_velocity_rad_s[side];
      speed[side] += w * rate;
      slope_speed[side] += slope * rate;
      current[side] += w * s.motor_current_a[side];
      least[side] = std::min(least[side], rate);
      greatest[side] = std::max(greatest[side], rate);
    }
    const double power_w[2] = {s.motor_voltage_v[0] * s.motor_current_a[0],
                               s.motor_voltage_v[1] * s.motor_current_a[1]};
    const double total_w = s.battery_voltage_v * s.battery_current_a;
    motors = motors && std::isfinite(s.motor_current_a[0]) && std::isfinite(s.motor_current_a[1]);
    battery = battery && std::isfinite(total_w);
    battery_w += w * total_w;
    motors_w += w * (power_w[0] + power_w[1]);
    motors_abs_w += w * (std::abs(power_w[0]) + std::abs(power_w[1]));
    battery_beside_w += w * (total_w - model_.battery_power_for({power_w[0], power_w[1]}));
    same_payload =
        same_payload && (s.payload_kg == buffer_.front().sample.payload_kg || !std::isfinite(s.payload_kg));
  }
  if (!same_payload || !(weight > 0)) return;

  // Scaled so that it is exact for speeds that are straight lines, whatever the samples' times.
  const double scale = slope_time - slope_sum * middle_s / weight;
  const telemetry::Sample& middle = buffer_[count / 2].sample;
  dynamics::Instant at;
  std::array<bool, 2> moving{}, resting{};
  for (std::size_t side : {0u, 1u}) {
    at.wheel_speed_rad_s[side] = speed[side] / weight;
    at.wheel_acceleration_rad_s2[side] = (slope_speed[side] - slope_sum * speed[side] / weight) / scale;
    current[side] /= weight;
    moving[side] = least[side] > moving_rad_s_ || greatest[side] < -moving_rad_s_;
    resting[side] = least[side] > -resting_rad_s && greatest[side] < resting_rad_s;
  }
  at.payload_kg = last_payload_kg_;
  at.x_m = middle.pose[0];
  at.y_m = middle.pose[1];
  at.heading_rad = middle.pose[2];
  at.climb_rad = climb / weight;

  payload_sum_kg_ += last_payload_kg_;
  ++windows_;
  if (motors) torque_equations(at, current, moving);
  const bool whole = (moving[0] || resting[0]) && (moving[1] || resting[1]);
  if (battery && motors && std::isfinite(motors_w)) {
    DriveEquation e{DriveEquation::Kind::idle, battery_beside_w / weight, {}};
    e.row[index(Unknown::idle_power)] = 1;
    e.row[index(Unknown::driver_loss)] = motors_abs_w / weight;
    equations_.push_back(e);
  } else if (battery && whole) {
    if (resting[0] && resting[1]) at.wheel_speed_rad_s = at.wheel_acceleration_rad_s2 = {};
    power_equation(at, battery_w / weight);
  }
}

void DriveWindows::torque_equations(const dynamics::Instant& at, const std::array<double, 2>& current_a,
                                    const std::array<bool, 2>& moving) {
  if (!moving[0] && !moving[1]) return;
  const dynamics::TorqueBalance<double> base = model_.balance(at);
  std::array<DriveEquation, 2> e{};
  for (std::size_t side : {0u, 1u}) {
    e[side].value = torque_per_a_ * current_a[side] - base.total_nm[side];
    e[side].row[index(Unknown::current_bias)] = torque_per_a_;
  }
  const auto fill = [&](std::size_t unknown, const dynamics::TorqueBalance<double>& changed, double step) {
    for (std::size_t side : {0u, 1u})
      e[side].row[unknown] = (changed.total_nm[side] - base.total_nm[side]) / step;
  };
  for (const Varied& v : varied_) fill(v.unknown, v.model.balance(at), v.step);
  dynamics::Instant heavier = at;
  heavier.payload_kg += 1;
  fill(index(Unknown::payload), model_.balance(heavier), 1);
  for (std::size_t side : {0u, 1u})
    if (moving[side]) equations_.push_back(e[side]);
}

void DriveWindows::power_equation(const dynamics::Instant& at, double power_w) {
  const dynamics::PowerFlow<double> base = model_.flow(at);
  DriveEquation e{DriveEquation::Kind::power, power_w - base.battery_power_w, {}};
  for (const Varied& v : varied_)
    e.row[v.unknown] = (v.model.flow(at).battery_power_w - base.battery_power_w) / v.step;
  dynamics::Instant heavier = at;
  heavier.payload_kg += 1;
  e.row[index(Unknown::payload)] = model_.flow(heavier).battery_power_w - base.battery_power_w;
  e.row[index(Unknown::driver_loss)] = std::abs(base.motor_power_w[0]) + std::abs(base.motor_power_w[1]);
  equations_.push_back(e);
}

}  // namespace joulecast::energy
