#include "energy/drive_equations.h"

#include <cmath>
#include <numbers>
#include <tuple>
#include <utility>

#include "base/try.h"

namespace joulecast::energy {
namespace {

constexpr double stretch_s = 10;              // of samples from which windows are made together
constexpr std::size_t voltage_lag = 10;       // windows
constexpr std::size_t most_equations = 6000;  // half an hour of driving

double seconds_between(const signals::Sample& from, const signals::Sample& to) {
  return 1e-6 * static_cast<double>(to.utime_us - from.utime_us);
}

constexpr std::size_t index(Unknown unknown) {
  return static_cast<std::size_t>(unknown);
}

}  // namespace

Result<DriveEquations> DriveEquations::make(const robot::RobotModel& robot) {
  TRY_ASSIGN(auto model, dynamics::drive_model(robot));
  DriveEquations equations(robot, std::move(model));
  const auto add = [&](Unknown unknown, double step, const robot::RobotModel& varied) -> Result<void> {
    TRY_ASSIGN(auto changed, dynamics::drive_model(varied));
    equations.varied_.push_back({index(unknown), step, std::move(changed)});
    return {};
  };
  robot::RobotModel varied = robot;
  const std::tuple<Unknown, double, double*> parameters[] = {
      {Unknown::friction_right, 0.01, &varied.motor.friction_torque_nm[robot::right]},
      {Unknown::friction_left, 0.01, &varied.motor.friction_torque_nm[robot::left]},
      {Unknown::viscous, 1e-3, &varied.motor.viscous_friction_nm_s_rad},
      {Unknown::idle_power, 1, &varied.idle_power_w},
      {Unknown::mass, 0.01 * robot.mass.chassis_kg, &varied.mass.chassis_kg}};
  for (const auto& [unknown, step, value] : parameters) {
    const double own = std::exchange(*value, *value + step);
    TRY(add(unknown, step, varied));
    *value = own;
  }
  const std::pair<Unknown, robot::AdoptedEffect> effects[] = {
      {Unknown::slope_cos, {"slope", {{"angle_rad", 1e-3}, {"uphill_rad", 0}}}},
      {Unknown::slope_sin, {"slope", {{"angle_rad", 1e-3}, {"uphill_rad", std::numbers::pi / 2}}}},
      {Unknown::scrub, {"turning_scrub", {{"coefficient", 1e-2}}}},
      {Unknown::yaw_inertia, {"yaw_inertia_error", {{"ratio", 1e-2}}}}};
  for (const auto& [unknown, effect] : effects) {
    varied.effects.push_back(effect);
    TRY(add(unknown, effect.parameters.front().second, varied));
    varied.effects.pop_back();
  }
  return equations;
}

DriveEquations::DriveEquations(const robot::RobotModel& robot, dynamics::DriveModel model)
    : robot_(robot),
      model_(std::move(model)),
      one_resistance_(robot.battery.resistance_curve.empty() && !robot.battery.activation_k),
      torque_per_a_(model_.parameters().torque_constant_nm_a),
      moving_rad_s_(moving_share * robot.limits.speed_m_s / robot.kinematics.wheel_radius_m) {}

std::vector<DriveEquation> DriveEquations::take() {
  interrupt();
  mean_payload_kg_ = windows_ > 0 ? payload_sum_kg_ / windows_ : 0;
  payload_sum_kg_ = windows_ = 0;
  recording_.payload_kg = 0;
  return std::exchange(equations_, {});
}

void DriveEquations::add(const signals::Sample& sample, double climb_rad) {
  std::vector<signals::Sample>& samples = recording_.samples;
  const bool another_payload = std::isfinite(sample.payload_kg) && sample.payload_kg != recording_.payload_kg;
  if (!samples.empty()) {
    const double interval_s = seconds_between(samples.back(), sample);
    if (!(interval_s > 0) || another_payload) interrupt();
  }
  if (another_payload) recording_.payload_kg = sample.payload_kg;
  samples.push_back(sample);
  samples.back().payload_kg = recording_.payload_kg;
  samples.back().pitch_rad = climb_rad;
  if (seconds_between(samples.front(), sample) > stretch_s) close_windows();
}

void DriveEquations::interrupt() {
  close_windows();
  recording_.samples.clear();
  battery_.clear();
}

// The next batch begins where the windows of this one end. A batch without windows is dropped.
void DriveEquations::close_windows() {
  std::vector<signals::Sample>& samples = recording_.samples;
  if (samples.size() < 2) return;
  const std::vector<windows::Window> made = windows::make_windows({&recording_, 1}, robot_, {});
  if (made.empty()) return samples.clear();
  for (windows::Window window : made) {
    for (std::size_t side : {0u, 1u}) {
      for (const auto& speed : window.part_speed_rad_s)
        window.moving[side] = window.moving[side] && std::abs(speed[side]) > moving_rad_s_;
    }
    add(window);
  }
  std::erase_if(samples, [&, begin = samples.front()](const signals::Sample& s) {
    return seconds_between(begin, s) < made.back().t_s;
  });
}

void DriveEquations::add(const windows::Window& w) {
  if (equations_.size() >= most_equations) return;
  dynamics::Instant at = windows::instant_of(w);
  payload_sum_kg_ += w.payload_kg;
  ++windows_;
  const bool motors = std::isfinite(w.current_a[0] + w.current_a[1]);
  const bool battery = std::isfinite(w.battery_power_w);
  if (motors) torque_equations(at, w);
  voltage_equation(w);
  if (battery && std::isfinite(w.motor_power_w[0] + w.motor_power_w[1])) {
    idle_equation(w);
  } else if (battery && windows::steady(w)) {
    if (w.resting[0] && w.resting[1]) at.wheel_speed_rad_s = at.wheel_acceleration_rad_s2 = {};
    power_equation(at, w.battery_power_w);
  }
}

void DriveEquations::torque_equations(const dynamics::Instant& at, const windows::Window& w) {
  if (!w.moving[0] && !w.moving[1]) return;
  const dynamics::TorqueBalance<double> base = model_.balance(at);
  std::array<DriveEquation, 2> e{};
  for (std::size_t side : {0u, 1u}) {
    e[side].value = torque_per_a_ * w.current_a[side] - base.total_nm[side];
    e[side].row[index(Unknown::current_bias)] = torque_per_a_;
  }
  const auto fill = [&](std::size_t unknown, const dynamics::TorqueBalance<double>& changed, double step) {
    for (std::size_t side : {0u, 1u})
      e[side].row[unknown] = (changed.total_nm[side] - base.total_nm[side]) / step;
  };
  for (const Varied& v : varied_) fill(v.unknown, v.model.balance(at), v.step);
  for (std::size_t side : {0u, 1u})
    if (w.moving[side]) equations_.push_back(e[side]);
}

// The battery's power other than the power that the motors consume and return.
void DriveEquations::idle_equation(const windows::Window& w) {
  const dynamics::Parameters<double>& p = model_.parameters();
  double modelled_w = p.idle_power_w + p.accessory_power_w;
  for (std::size_t side : {0u, 1u})
    modelled_w +=
        w.motor_power_w[side] + p.driver_loss * w.motor_power_abs_w[side] + p.unreturned * w.braking_w[side];
  DriveEquation e{DriveEquation::Kind::idle, w.battery_power_w - modelled_w, {}};
  e.row[index(Unknown::idle_power)] = 1;
  e.row[index(Unknown::driver_loss)] = w.motor_power_abs_w[0] + w.motor_power_abs_w[1];
  equations_.push_back(e);
}

void DriveEquations::voltage_equation(const windows::Window& w) {
  if (!one_resistance_ || !std::isfinite(w.battery_voltage_v + w.battery_current_a)) return;
  battery_.push_back({w.battery_voltage_v, w.battery_current_a});
  if (battery_.size() <= voltage_lag) return;
  const double voltage_v = battery_.back()[0] - battery_.front()[0],
               current_a = battery_.back()[1] - battery_.front()[1];
  battery_.pop_front();
  DriveEquation e{
      DriveEquation::Kind::voltage, voltage_v + robot_.battery.internal_resistance_ohm * current_a, {}};
  e.row[index(Unknown::battery_resistance)] = -current_a;
  equations_.push_back(e);
}

// All of the battery's power against the model's.
void DriveEquations::power_equation(const dynamics::Instant& at, double power_w) {
  const dynamics::PowerFlow<double> base = model_.flow(at);
  DriveEquation e{DriveEquation::Kind::power, power_w - base.battery_power_w, {}};
  for (const Varied& v : varied_)
    e.row[v.unknown] = (v.model.flow(at).battery_power_w - base.battery_power_w) / v.step;
  e.row[index(Unknown::driver_loss)] = std::abs(base.motor_power_w[0]) + std::abs(base.motor_power_w[1]);
  equations_.push_back(e);
}

}  // namespace joulecast::energy
