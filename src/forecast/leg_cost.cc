#include "forecast/leg_cost.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/median.h"

namespace joulecast::forecast {
namespace {

constexpr double usual_share = 0.7;    // of the limits
constexpr std::size_t least_legs = 5;  // that a habit is read from
constexpr double least_ramp_s = 0.02;  // a jump of speed would cost infinite power
constexpr double no_plateau = 1.8;     // cruise over mean speed beyond which a leg is all ramp
constexpr std::array<double, 4> node{0.06943184420297371, 0.33000947820757187, 0.6699905217924281,
                                     0.9305681557970263};
constexpr std::array<double, 4> weight{0.17392742256872692, 0.32607257743127307, 0.32607257743127307,
                                       0.17392742256872692};

}  // namespace

Pace default_pace(const robot::RobotModel& robot) {
  const robot::Limits& most = robot.limits;
  return {usual_share * most.speed_m_s, usual_share * most.acceleration_m_s2,
          usual_share * most.yaw_rate_rad_s,
          usual_share * most.acceleration_m_s2 / robot.kinematics.half_track_m, 0};
}

Pace usual_pace(const robot::RobotModel& robot, std::span<const Leg> past) {
  Pace pace = default_pace(robot);
  std::vector<double> speed, acceleration, rate, yaw_acceleration, pause;
  const auto ramp_s = [](const Leg& leg) { return leg.duration_s - leg.way / leg.speed; };
  // How long a leg is slower than what counts as still, at either end.
  const auto tail_s = [&](const Leg& leg) {
    if (leg.motion == Motion::stand || !(ramp_s(leg) > least_ramp_s)) return 0.0;
    const double still = still_speed_m_s(robot);
    const double rim = leg.motion == Motion::turn ? robot.kinematics.half_track_m : 1;
    return std::min(ramp_s(leg), still / (rim * leg.speed) * ramp_s(leg));
  };
  for (std::size_t k = 0; k < past.size(); ++k) {
    const Leg& leg = past[k];
    if (leg.motion == Motion::stand) {
      if (k > 0 && k + 1 < past.size())
        pause.push_back(std::max(0.0, leg.duration_s - tail_s(past[k - 1]) - tail_s(past[k + 1])));
      continue;
    }
    if (!(ramp_s(leg) > least_ramp_s)) continue;
    const bool plateau = leg.speed * leg.duration_s < no_plateau * leg.way;
    if (leg.motion == Motion::drive) {
      if (plateau) speed.push_back(leg.speed);
      acceleration.push_back(leg.speed / ramp_s(leg));
    } else {
      if (plateau) rate.push_back(leg.speed);
      yaw_acceleration.push_back(leg.speed / ramp_s(leg));
    }
  }
  const auto take = [](std::vector<double>& shown, double& into) {
    if (shown.size() >= least_legs) into = upper_median(shown);
  };
  take(speed, pace.speed_m_s);
  take(acceleration, pace.acceleration_m_s2);
  take(rate, pace.yaw_rate_rad_s);
  take(yaw_acceleration, pace.yaw_acceleration_rad_s2);
  take(pause, pace.pause_s);
  return pace;
}

std::vector<PlannedLeg> planned_legs(const planning::Path& path) {
  std::vector<PlannedLeg> legs;
  legs.reserve(2 * path.runs.size());
  for (const planning::Run& run : path.runs) {
    if (run.dwell_before_s > 0) legs.push_back({Motion::stand, 0, 0, run.payload_kg, run.dwell_before_s});
    PlannedLeg leg{run.turn != 0 ? Motion::turn : Motion::drive, run.length(), 0, run.payload_kg, 0};
    if (run.turn == 0) {
      double turned = 0;
      for (std::size_t k = 1; k < run.knots.size(); ++k) {
        turned += 0.5 * (run.knots[k - 1].curvature_1_m + run.knots[k].curvature_1_m) *
                  (run.knots[k].way - run.knots[k - 1].way);
      }
      leg.curvature_1_m = std::fabs(turned) / leg.way;
    }
    legs.push_back(leg);
  }
  if (path.dwell_after_s > 0)
    legs.push_back({Motion::stand, 0, 0, path.final_payload_kg, path.dwell_after_s});
  return legs;
}

LegPricer::LegPricer(const robot::RobotModel& robot, const dynamics::DriveModel& drive)
    : drive_(&drive), limits_(robot.limits), standing_w_(drive.battery_power_for({0, 0})) {}

LegCost LegPricer::standing(double duration_s) const {
  return {duration_s, standing_w_ * duration_s, 0, 0};
}

double LegPricer::power_w(const Power& kind, double v, double a) const {
  const dynamics::Parameters<double>& p = drive_->parameters();
  const bool turning = kind.motion == Motion::turn;
  dynamics::Instant at;
  at.payload_kg = kind.payload_kg;
  at.wheel_speed_rad_s = dynamics::wheels_of_body(p, turning ? 0 : v, turning ? v : v * kind.curvature_1_m);
  at.wheel_acceleration_rad_s2 =
      dynamics::wheels_of_body(p, turning ? 0 : a, turning ? a : a * kind.curvature_1_m);
  return drive_->flow(at).battery_power_w - standing_w_;
}

// Six evaluations give the six coefficients; three more must agree with them, braking hard among them, where
// a robot that does not regenerate departs from the parabola.
std::optional<dynamics::QuadraticPower> LegPricer::closed_form(const Power& kind) const {
  const bool turning = kind.motion == Motion::turn;
  const double v = turning ? limits_.yaw_rate_rad_s : limits_.speed_m_s;
  const double a =
      turning ? limits_.acceleration_m_s2 / drive_->parameters().half_track_m : limits_.acceleration_m_s2;
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

const LegPricer::Power& LegPricer::power_of(Motion motion, double curvature_1_m, double payload_kg) const {
  const auto found = std::ranges::find_if(known_, [&](const Power& k) {
    return k.motion == motion && k.curvature_1_m == curvature_1_m && k.payload_kg == payload_kg;
  });
  if (found != known_.end()) return *found;
  // Curves seldom share their curvature: the closed form would cost more than it saves.
  constexpr std::size_t most = 32;
  if (known_.size() == most) known_.clear();
  Power kind{motion, curvature_1_m, payload_kg, {}};
  if (curvature_1_m == 0) kind.closed = closed_form(kind);
  return known_.emplace_back(kind);
}

LegCost LegPricer::trapezoid(Motion motion, double way, double curvature_1_m, double payload_kg, double speed,
                             double ramp_s) const {
  const Power& kind = power_of(motion, curvature_1_m, payload_kg);
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
    for (std::size_t k = 0; k < node.size(); ++k)
      cost.motor_j +=
          weight[k] * ramp_s * (power_w(kind, speed * node[k], a) + power_w(kind, speed * node[k], -a));
    cost.motor_j += cruise_s * power_w(kind, speed, 0);
  }
  cost.speed_fraction = speed / (motion == Motion::turn ? limits_.yaw_rate_rad_s : limits_.speed_m_s);
  return cost;
}

LegCost LegPricer::driven(const Leg& leg) const {
  if (leg.motion == Motion::stand || !(leg.way > 0)) return standing(leg.duration_s);
  LegCost cost = trapezoid(leg.motion, leg.way, leg.curvature_1_m, leg.payload_kg, leg.speed,
                           leg.duration_s - leg.way / leg.speed);
  cost.duration_s = leg.duration_s;
  cost.standing_j = standing_w_ * leg.duration_s;
  return cost;
}

LegCost LegPricer::paced(const PlannedLeg& leg, const Pace& pace) const {
  if (leg.motion == Motion::stand || !(leg.way > 0)) return standing(leg.duration_s);
  double speed = pace.yaw_rate_rad_s, acceleration = pace.yaw_acceleration_rad_s2;
  if (leg.motion == Motion::drive) {
    speed = pace.speed_m_s;
    acceleration = pace.acceleration_m_s2;
    if (leg.curvature_1_m > 0) speed = std::min(speed, limits_.yaw_rate_rad_s / leg.curvature_1_m);
  }
  speed = std::min(speed, std::sqrt(leg.way * acceleration));
  return trapezoid(leg.motion, leg.way, leg.curvature_1_m, leg.payload_kg, speed, speed / acceleration);
}

LegCost LegPricer::paced(const Leg& leg, const Pace& pace) const {
  return paced(PlannedLeg{leg.motion, leg.way, leg.curvature_1_m, leg.payload_kg, leg.duration_s}, pace);
}

}  // namespace joulecast::forecast
