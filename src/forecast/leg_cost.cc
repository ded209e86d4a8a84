#include "forecast/leg_cost.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "planning/numerics.h"

namespace joulecast::forecast {

LegPricer::LegPricer(const robot::RobotModel& robot, const dynamics::DriveModel& drive)
    : drive_(&drive),
      limits_(robot.limits),
      voltage_limit_v_(robot.battery.nominal_voltage_v),
      current_limit_a_(robot.limits.current_a),
      standing_w_(drive.battery_power_for({0, 0})) {}

dynamics::Instant LegPricer::instant(const Power& kind, double v, double a) const {
  const dynamics::Parameters<double>& p = drive_->parameters();
  const bool turning = kind.motion == Motion::turn;
  dynamics::Instant at;
  at.payload_kg = kind.payload_kg;
  at.wheel_speed_rad_s = dynamics::wheels_of_body(p, turning ? 0 : v, turning ? v : v * kind.curvature_1_m);
  at.wheel_acceleration_rad_s2 =
      dynamics::wheels_of_body(p, turning ? 0 : a, turning ? a : a * kind.curvature_1_m);
  return at;
}

double LegPricer::power_w(const Power& kind, double v, double a) const {
  return drive_->flow(instant(kind, v, a)).battery_power_w - standing_w_;
}

Cruise LegPricer::greatest(Motion motion) const {
  if (motion == Motion::turn)
    return {limits_.yaw_rate_rad_s, limits_.acceleration_m_s2 / drive_->parameters().half_track_m};
  return {limits_.speed_m_s, limits_.acceleration_m_s2};
}

bool LegPricer::reaches(const Power& kind, double v, double a) const {
  const auto flow = drive_->flow(instant(kind, v, a));
  for (std::size_t side = 0; side < 2; ++side) {
    if (voltage_limit_v_ > 0 && std::fabs(flow.voltage_v[side]) > voltage_limit_v_) return false;
    if (current_limit_a_ > 0 && std::fabs(flow.current_a[side]) > current_limit_a_) return false;
  }
  return true;
}

Reachable LegPricer::reachable(const Power& kind, const Cruise& wanted) const {
  Reachable found{wanted, true, 0, 0};
  const Cruise most = greatest(kind.motion);
  if (kind.unbound && wanted.speed <= most.speed && wanted.acceleration <= most.acceleration) return found;
  if (reaches(kind, wanted.speed, wanted.acceleration)) return found;
  constexpr int halvings = 30;
  constexpr double creeping = 5e-3;  // of the limits, for any wanted cruise
  const Cruise least{creeping * most.speed, creeping * most.acceleration};
  const auto flow = drive_->flow(instant(kind, least.speed, least.acceleration));
  for (std::size_t side = 0; side < 2; ++side) {
    found.creeping_voltage_v = std::max(found.creeping_voltage_v, std::fabs(flow.voltage_v[side]));
    found.creeping_current_a = std::max(found.creeping_current_a, std::fabs(flow.current_a[side]));
  }
  found.moves = reaches(kind, least.speed, least.acceleration);
  if (!found.moves) return found;
  double& speed = found.cruise.speed;
  if (!reaches(kind, speed, 0)) {
    constexpr double usable = 0.95;  // of the speed at which no torque for acceleration is left
    speed = usable * planning::last_that([&](double v) { return reaches(kind, v, 0); },
                                         std::min(least.speed, speed), speed, halvings);
  }
  if (double& a = found.cruise.acceleration; !reaches(kind, speed, a)) {
    a = planning::last_that([&](double less) { return reaches(kind, speed, less); }, 0, a, halvings);
    found.moves = a > 0;
  }
  return found;
}

Reachable LegPricer::reachable(Motion motion, double curvature_1_m, double payload_kg,
                               const Cruise& wanted) const {
  return reachable(power_of(motion, curvature_1_m, payload_kg, false), wanted);
}

Error LegPricer::obstacle(const PlannedLeg& leg) const {
  const Cruise most = greatest(leg.motion);
  const Reachable within = reachable(leg.motion, leg.curvature_1_m, leg.payload_kg, most);
  const bool by_voltage = voltage_limit_v_ > 0 && within.creeping_voltage_v > voltage_limit_v_;
  return {Fault::infeasible, by_voltage ? "limits/voltage_v" : "limits/current_a",
          fmt::format("is {:.6g}, must be at least {:.6g} to {} with {:.4g} kg",
                      by_voltage ? voltage_limit_v_ : current_limit_a_,
                      by_voltage ? within.creeping_voltage_v : within.creeping_current_a,
                      leg.motion == Motion::turn ? "turn" : "drive", leg.payload_kg)};
}

// Six evaluations give the six coefficients; three more must agree with them, braking hard among them, where
// a robot that does not regenerate departs from the parabola.
std::optional<dynamics::QuadraticPower> LegPricer::closed_form(const Power& kind) const {
  const auto [v, a] = greatest(kind.motion);
  const double p1 = power_w(kind, v / 3, 0), p2 = power_w(kind, 2 * v / 3, 0), p3 = power_w(kind, v, 0);
  const double up = power_w(kind, v / 3, a), down = power_w(kind, v / 3, -a), fast = power_w(kind, v, a);
  dynamics::QuadraticPower q;
  q.c2 = 4.5 * (p3 - 2 * p2 + p1) / (v * v);
  q.c3 = 1.5 * (p3 - p1) / v - q.c2 * v * 4 / 3;
  q.c0 = p3 - (q.c2 * v + q.c3) * v;
  q.c1 = (0.5 * (up + down) - p1) / (a * a);
  const double slow_slope = 0.5 * (up - down) / a, fast_slope = (fast - p3) / a - q.c1 * a;
  q.cx = 1.5 * (fast_slope - slow_slope) / v;
  q.ca = fast_slope - q.cx * v;
  constexpr double smoothing = 1e-4;  // the drive model's dry friction sets in smoothly near rest
  const double scale = smoothing * (std::fabs(p3) + std::fabs(fast));
  for (const auto& [speed, acceleration] :
       {std::pair{v, -a}, std::pair{0.07 * v, 0.4 * a}, std::pair{0.07 * v, -0.4 * a}}) {
    if (!(std::fabs(q.power_w(speed, acceleration) - power_w(kind, speed, acceleration)) <= scale))
      return std::nullopt;
  }
  return q;
}

const LegPricer::Power& LegPricer::power_of(Motion motion, double curvature_1_m, double payload_kg,
                                            bool often) const {
  const auto found = std::ranges::find_if(known_, [&](const Power& k) {
    return k.motion == motion && k.curvature_1_m == curvature_1_m && k.payload_kg == payload_kg;
  });
  Power* kind = found != known_.end() ? &*found : nullptr;
  if (kind == nullptr) {
    constexpr std::size_t most = 32;
    if (known_.size() == most) known_.clear();
    kind = &known_.emplace_back(Power{motion, curvature_1_m, payload_kg, {}});
    const Cruise top = greatest(motion);
    kind->unbound = reaches(*kind, top.speed, top.acceleration);
  }
  // Curves rarely share their curvature: for one price, the closed form would cost more than it saves.
  if (!kind->tried && (often || curvature_1_m == 0)) {
    kind->closed = closed_form(*kind);
    kind->tried = true;
  }
  return *kind;
}

LegCost LegPricer::trapezoid(const Power& kind, double way, double speed, double ramp_s) const {
  ramp_s = std::max(ramp_s, least_ramp_s);
  const double cruise_s = std::max(0.0, way / speed - ramp_s), a = speed / ramp_s;
  LegCost cost;
  cost.duration_s = cruise_s + 2 * ramp_s;
  cost.standing_j = standing_w_ * cost.duration_s;
  if (kind.closed) {
    // Both ramps together: terms odd in acceleration cancel.
    const dynamics::QuadraticPower& q = *kind.closed;
    const double ramps = q.c1 * a * a + q.c2 * speed * speed / 3 + q.c3 * speed / 2 + q.c0;
    cost.motor_j = 2 * ramp_s * ramps + cruise_s * q.power_w(speed, 0);
  } else {
    for (const auto& [at, weight] : planning::gauss4)
      cost.motor_j += weight * ramp_s * (power_w(kind, speed * at, a) + power_w(kind, speed * at, -a));
    cost.motor_j += cruise_s * power_w(kind, speed, 0);
  }
  cost.speed_fraction = speed / (kind.motion == Motion::turn ? limits_.yaw_rate_rad_s : limits_.speed_m_s);
  return cost;
}

LegCost LegPricer::driven(const Leg& leg, bool planned) const {
  if (planned && leg.planned_way > 0)
    return driven({leg.motion, leg.planned_s, leg.planned_way, leg.planned_speed, leg.curvature_1_m,
                   leg.payload_kg, 0});
  if (leg.motion == Motion::stand || !(leg.way > 0)) return standing(leg.duration_s);
  LegCost cost = trapezoid(power_of(leg.motion, leg.curvature_1_m, leg.payload_kg, false), leg.way, leg.speed,
                           leg.duration_s - leg.way / leg.speed);
  cost.duration_s = leg.duration_s;
  cost.standing_j = standing_w_ * leg.duration_s;
  return cost;
}

LegCost LegPricer::priced(const Power& kind, double way, Cruise cruise) const {
  if (kind.motion == Motion::drive && kind.curvature_1_m > 0)
    cruise.speed = std::min(cruise.speed, limits_.yaw_rate_rad_s / kind.curvature_1_m);
  cruise.speed = std::min(cruise.speed, std::sqrt(way * cruise.acceleration));
  const Reachable within = reachable(kind, cruise);
  if (!within.moves) {
    LegCost cost;
    cost.impossible = true;
    return cost;
  }
  const double speed = std::min(within.cruise.speed, std::sqrt(way * within.cruise.acceleration));
  LegCost cost = trapezoid(kind, way, speed, speed / within.cruise.acceleration);
  cost.slower = within.cruise.speed < cruise.speed || within.cruise.acceleration < cruise.acceleration;
  return cost;
}

LegCost LegPricer::paced(const PlannedLeg& leg, const Cruise& cruise) const {
  if (leg.motion == Motion::stand || !(leg.way > 0)) return standing(leg.duration_s);
  return priced(power_of(leg.motion, leg.curvature_1_m, leg.payload_kg, false), leg.way, cruise);
}

LegCost LegPricer::paced(const PlannedLeg& leg, const Pace& pace) const {
  return paced(leg, leg.motion == Motion::turn ? Cruise{pace.yaw_rate_rad_s, pace.yaw_acceleration_rad_s2}
                                               : Cruise{pace.speed_m_s, pace.acceleration_m_s2});
}

LegCost LegPricer::usual(const PlannedLeg& leg, const Habit& habit) const {
  if (leg.motion == Motion::stand || !(leg.way > 0)) return standing(leg.duration_s);
  const LegKind kind = kind_of(leg.motion, leg.way, leg.curvature_1_m);
  const auto& cruises = habit.cruises[static_cast<std::size_t>(kind)];
  const Power& power = power_of(leg.motion, kind == LegKind::curve ? leg.curvature_1_m : 0, leg.payload_kg,
                                cruises.size() > 1);
  const double share = 1 / static_cast<double>(cruises.size());
  LegCost mean;
  for (const Cruise& cruise : cruises) {
    const LegCost one = priced(power, leg.way, cruise);
    mean.duration_s += share * one.duration_s;
    mean.standing_j += share * one.standing_j;
    mean.motor_j += share * one.motor_j;
    mean.speed_fraction += share * one.speed_fraction;
    mean.slower = mean.slower || one.slower;
    mean.impossible = mean.impossible || one.impossible;
  }
  return mean;
}

LegCost LegPricer::usual(const Leg& leg, const Habit& habit) const {
  return usual(PlannedLeg{leg.motion, leg.way, leg.curvature_1_m, leg.payload_kg, leg.duration_s}, habit);
}

std::optional<Limitation> limitation(const LegPricer& pricer, const robot::RobotModel& robot,
                                     const Pace& wanted, double payload_kg) {
  const Reachable drive =
      pricer.reachable(Motion::drive, 0, payload_kg, {wanted.speed_m_s, wanted.acceleration_m_s2});
  const Reachable turn =
      pricer.reachable(Motion::turn, 0, payload_kg, {wanted.yaw_rate_rad_s, wanted.yaw_acceleration_rad_s2});
  std::string allowed = fmt::format("{:.4g} V", robot.battery.nominal_voltage_v);
  if (robot.limits.current_a > 0) allowed += fmt::format(" and {:.4g} A", robot.limits.current_a);
  for (const auto& [within, motion] : {std::pair{&drive, "drive"}, std::pair{&turn, "turn"}}) {
    if (within->moves) continue;
    return Limitation{
        false,
        {},
        fmt::format("With {:.4g} kg the robot cannot {}: that takes {:.4g} V and {:.4g} A at the least, and "
                    "its motors have {}.",
                    payload_kg, motion, within->creeping_voltage_v, within->creeping_current_a, allowed)};
  }
  constexpr double noticed = 0.999;
  const auto less = [](double reached, double asked) { return reached < noticed * asked; };
  Limitation slower{true, wanted, {}};
  slower.reached.speed_m_s = drive.cruise.speed;
  slower.reached.acceleration_m_s2 = drive.cruise.acceleration;
  slower.reached.yaw_rate_rad_s = turn.cruise.speed;
  slower.reached.yaw_acceleration_rad_s2 = turn.cruise.acceleration;
  std::string what;
  const auto add = [&](double reached, double asked, const char* unit) {
    if (!less(reached, asked)) return;
    what += fmt::format("{}{:.3g} {} instead of {:.3g}", what.empty() ? "" : ", ", reached, unit, asked);
  };
  add(drive.cruise.speed, wanted.speed_m_s, "m/s");
  add(drive.cruise.acceleration, wanted.acceleration_m_s2, "m/s^2");
  add(turn.cruise.speed, wanted.yaw_rate_rad_s, "rad/s");
  add(turn.cruise.acceleration, wanted.yaw_acceleration_rad_s2, "rad/s^2");
  if (what.empty()) return std::nullopt;
  slower.sentence =
      fmt::format("With {:.4g} kg the robot's motors, which have {}, reach {}.", payload_kg, allowed, what);
  return slower;
}

}  // namespace joulecast::forecast
