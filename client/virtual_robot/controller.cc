#include "client/virtual_robot/controller.h"

#include <algorithm>
#include <cmath>

namespace joulecast::virtual_robot {
namespace {

constexpr double duty_limit = 0.97;
constexpr double friction_ramp_rad_s = 0.05;
constexpr double rest_rad_s = 0.03;  // slower than this and commanded to rest: the brake releases the motors

}  // namespace

SpeedController::SpeedController(const RobotParameters& robot, const ControllerTuning& tuning)
    : robot_(robot),
      tuning_(tuning),
      torque_per_a_(robot.torque_constant_nm_a * robot.gear_ratio),
      emf_per_rad_s_(robot.voltage_constant_v_s_rad * robot.gear_ratio) {
  set_payload(0);
}

void SpeedController::set_payload(double declared_kg) {
  const double mass_kg = robot_.chassis_kg + 2 * robot_.wheel_kg + declared_kg;
  const double yaw_kg_m2 = robot_.yaw_inertia_kg_m2 + 0.02 * declared_kg;
  const double lever = robot_.wheel_radius_m / robot_.half_track_m;
  straight_inertia_ =
      robot_.wheel_inertia_kg_m2 + 0.5 * mass_kg * robot_.wheel_radius_m * robot_.wheel_radius_m;
  turning_inertia_ = robot_.wheel_inertia_kg_m2 + 0.5 * yaw_kg_m2 * lever * lever;

  // The loop is w' = -a w + b V about a steady speed; poles twice at the natural frequency where V makes that
  // possible.
  const double inertia = std::min(straight_inertia_, turning_inertia_);
  const double a = torque_per_a_ * emf_per_rad_s_ / (robot_.resistance_ohm * inertia);
  const double b = torque_per_a_ / (robot_.resistance_ohm * inertia);
  proportional_v_s_ = std::max((2 * tuning_.natural_rad_s - a) / b, 0.3 * emf_per_rad_s_);
  integral_v_ = tuning_.natural_rad_s * tuning_.natural_rad_s / b;
}

std::array<double, 2> SpeedController::update(const BodyCommand& command,
                                              const std::array<double, 2>& encoder_rad_s,
                                              double battery_voltage_v) {
  std::array<double, 2> voltage{};
  for (std::size_t s : {0u, 1u}) {
    const double side = s == 0 ? 1 : -1;
    const double target =
        (command.speed_m_s + side * robot_.half_track_m * command.yaw_rate_rad_s) / robot_.wheel_radius_m;
    if (command.speed_m_s == 0 && command.yaw_rate_rad_s == 0 && std::abs(encoder_rad_s[s]) < rest_rad_s) {
      trim_v_[s] = 0;
      continue;
    }
    const double torque_nm =
        (straight_inertia_ * command.acceleration_m_s2 +
         side * turning_inertia_ * robot_.half_track_m * command.yaw_acceleration_rad_s2) /
            robot_.wheel_radius_m +
        robot_.viscous_friction_nm_s_rad * target +
        robot_.friction_torque_nm[s] * std::tanh(target / friction_ramp_rad_s);
    const double forward_v =
        tuning_.feed_forward * (robot_.resistance_ohm * torque_nm / torque_per_a_ + emf_per_rad_s_ * target);
    const double error = target - encoder_rad_s[s];
    const double wanted_v = forward_v + proportional_v_s_ * error + trim_v_[s];

    const double emf_v = emf_per_rad_s_ * encoder_rad_s[s];
    const double reach_v = robot_.resistance_ohm * robot_.current_limit_a;
    const double top_v = duty_limit * battery_voltage_v;
    voltage[s] = std::clamp(std::clamp(wanted_v, emf_v - reach_v, emf_v + reach_v), -top_v, top_v);
    const bool winds_up = (wanted_v > voltage[s] && error > 0) || (wanted_v < voltage[s] && error < 0);
    if (!winds_up) trim_v_[s] += integral_v_ * error * period_s;
  }
  return voltage;
}

}  // namespace joulecast::virtual_robot
