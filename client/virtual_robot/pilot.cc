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
  const double settled = settle_s_;
  duration_s_ = std::visit(
      Overloaded{[&](const GoTo& leg) {
                   profile_ = {std::hypot(leg.x_m - x_m, leg.y_m - y_m), leg.speed_m_s, leg.acceleration_m_s2,
                               smooth_ramps_};
                   return profile_.duration_s() + settled;
                 },
                 [&](const TurnTo& leg) {
                   const double turn = wrapped(std::atan2(leg.y_m - y_m, leg.x_m - x_m) - heading_rad);
                   turn_sign_ = turn < 0 ? -1 : 1;
                   profile_ = {std::abs(turn), leg.rate_rad_s, leg.acceleration_rad_s2, smooth_ramps_};
                   return profile_.duration_s() + settled;
                 },
                 [&](const Arc& leg) {
                   turn_sign_ = leg.angle_rad < 0 ? -1 : 1;
                   profile_ = {leg.radius_m * std::abs(leg.angle_rad), leg.speed_m_s, leg.acceleration_m_s2,
                               smooth_ramps_};
                   return profile_.duration_s() + settled;
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

}  // namespace joulecast::virtual_robot
