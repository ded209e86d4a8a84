#include "client/virtual_robot/pilot.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/overloaded.h"

namespace joulecast::virtual_robot {
namespace {

constexpr double steer_gain_1_s = 1.2;
constexpr double steer_limit_rad_s = 0.25;
constexpr double steer_until_m = 0.6;  // nearer than this the bearing swings too fast to follow

double wrapped(double angle_rad) {
  return std::remainder(angle_rad, 2 * std::numbers::pi);
}

constexpr double duty_limit = 0.97;
constexpr double friction_ramp_rad_s = 0.05;
constexpr double rest_rad_s = 0.03;  // slower than this and commanded to rest: the brake releases the motors

}  // namespace

Trapezoid::Trapezoid(double distance, double speed, double acceleration, bool smooth)
    : speed_(std::min(speed, std::sqrt(distance * acceleration))),
      acceleration_(acceleration),
      smooth_(smooth) {
  if (distance <= 0) return;
  ramp_s_ = speed_ / acceleration_;
  duration_s_ = distance / speed_ + ramp_s_;
}

double Trapezoid::speed(double time_s) const {
  if (time_s <= 0 || time_s >= duration_s_) return 0;
  if (smooth_) {
    const double into_s = std::min({time_s, duration_s_ - time_s, ramp_s_});
    return 0.5 * speed_ * (1 - std::cos(std::numbers::pi * into_s / ramp_s_));
  }
  return std::min({speed_, acceleration_ * time_s, acceleration_ * (duration_s_ - time_s)});
}

double Trapezoid::acceleration(double time_s) const {
  if (time_s < 0 || time_s >= duration_s_) return 0;
  const bool up = time_s < ramp_s_;
  if (!up && time_s <= duration_s_ - ramp_s_) return 0;
  const double sign = up ? 1 : -1;
  if (!smooth_) return sign * acceleration_;
  const double into_s = up ? time_s : duration_s_ - time_s;
  return sign * acceleration_ * 0.5 * std::numbers::pi * std::sin(std::numbers::pi * into_s / ramp_s_);
}

void Pilot::begin(MissionScript script) {
  script_ = std::move(script);
  payload_kg_ = script_.payload_kg;
  leg_ = 0;
  begun_ = false;
}

void Pilot::begin_leg(double x_m, double y_m, double heading_rad) {
  time_s_ = 0;
  begun_ = true;
  profile_ = {};
  const auto over = [&](double way, double speed, double acceleration) {
    profile_ = {way, speed, acceleration, smooth_ramps_};
    return profile_.duration_s() + settle_s_;
  };
  duration_s_ = std::visit(
      Overloaded{[&](const GoTo& leg) {
                   return over(std::hypot(leg.x_m - x_m, leg.y_m - y_m), leg.speed_m_s,
                               leg.acceleration_m_s2);
                 },
                 [&](const TurnTo& leg) {
                   const double turn = wrapped(std::atan2(leg.y_m - y_m, leg.x_m - x_m) - heading_rad);
                   turn_sign_ = turn < 0 ? -1 : 1;
                   return over(std::abs(turn), leg.rate_rad_s, leg.acceleration_rad_s2);
                 },
                 [&](const Arc& leg) {
                   turn_sign_ = leg.angle_rad < 0 ? -1 : 1;
                   return over(leg.radius_m * std::abs(leg.angle_rad), leg.speed_m_s, leg.acceleration_m_s2);
                 },
                 [&](const Dwell& leg) { return leg.duration_s; },
                 [&](const Load& leg) {
                   payload_kg_ = leg.payload_kg;
                   return 0.0;
                 }},
      script_.legs[leg_]);
}

BodyCommand Pilot::follow(double x_m, double y_m, double heading_rad) const {
  BodyCommand command;
  const double rate = profile_.speed(time_s_);
  const double change = profile_.acceleration(time_s_);
  if (const auto* straight = std::get_if<GoTo>(&script_.legs[leg_])) {
    command.speed_m_s = rate;
    command.acceleration_m_s2 = change;
    const double ahead_m = std::hypot(straight->x_m - x_m, straight->y_m - y_m);
    if (ahead_m > steer_until_m && rate > 0) {
      const double bearing = std::atan2(straight->y_m - y_m, straight->x_m - x_m);
      // Steering grows with speed: at rest it would turn in place.
      const double gain = steer_gain_1_s * std::min(1.0, rate / (0.2 * robot_.speed_limit_m_s));
      command.yaw_rate_rad_s =
          std::clamp(gain * wrapped(bearing - heading_rad), -steer_limit_rad_s, steer_limit_rad_s);
    }
  } else if (std::holds_alternative<TurnTo>(script_.legs[leg_])) {
    command.yaw_rate_rad_s = turn_sign_ * rate;
    command.yaw_acceleration_rad_s2 = turn_sign_ * change;
  } else if (const auto* arc = std::get_if<Arc>(&script_.legs[leg_])) {
    command.speed_m_s = rate;
    command.acceleration_m_s2 = change;
    command.yaw_rate_rad_s = turn_sign_ * rate / arc->radius_m;
    command.yaw_acceleration_rad_s2 = turn_sign_ * change / arc->radius_m;
  }
  return command;
}

BodyCommand Pilot::update(double x_m, double y_m, double heading_rad) {
  while (!done()) {
    if (!begun_) begin_leg(x_m, y_m, heading_rad);
    if (time_s_ < duration_s_) {
      const BodyCommand command = follow(x_m, y_m, heading_rad);
      time_s_ += SpeedController::period_s;
      return command;
    }
    ++leg_;
    begun_ = false;
  }
  return {};
}

SpeedController::SpeedController(const RobotParameters& robot, const ControllerTuning& tuning)
    : robot_(robot),
      tuning_(tuning),
      torque_per_a_(robot.torque_constant_nm_a * robot.gear_ratio),
      emf_per_rad_s_(robot.voltage_constant_v_s_rad * robot.gear_ratio) {
  set_payload(0);
}

void SpeedController::set_payload(double declared_kg) {
  const double mass_kg = robot_.chassis_kg + 2 * robot_.wheel_kg + declared_kg;
  const double yaw_kg_m2 = robot_.yaw_inertia_kg_m2 + robot_.payload_yaw_inertia_m2 * declared_kg;
  const double lever = robot_.wheel_radius_m / robot_.half_track_m;
  straight_inertia_ =
      robot_.wheel_inertia_kg_m2 + 0.5 * mass_kg * robot_.wheel_radius_m * robot_.wheel_radius_m;
  turning_inertia_ = robot_.wheel_inertia_kg_m2 + 0.5 * yaw_kg_m2 * lever * lever;

  // The loop is w' = -a w + b V about a steady speed; poles twice at the natural frequency where V allows it.
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
