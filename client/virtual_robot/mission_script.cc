#include "client/virtual_robot/mission_script.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "client/virtual_robot/pilot.h"

namespace joulecast::virtual_robot {
namespace {

constexpr std::array<double, 6> payload_fractions{0, 0, 0.25, 0.5, 0.75, 1};
constexpr int placement_tries = 40;
constexpr double shortest_leg_m = 1.5;
constexpr double longest_leg_m = 9;

double draw_payload(const RobotParameters& robot, Rng& rng) {
  return robot.payload_limit_kg * payload_fractions[rng.index(payload_fractions.size())];
}

// Speeds and accelerations over the whole permitted range, to separate friction laws, inertia and losses.
struct Pace {
  double speed_m_s, acceleration_m_s2;
};

Pace draw_pace(const RobotParameters& robot, const ScriptOptions& options, Rng& rng) {
  return {robot.speed_limit_m_s * rng.uniform(options.slowest_fraction, options.fastest_fraction),
          robot.acceleration_limit_m_s2 * rng.uniform(options.gentlest_fraction, options.hardest_fraction)};
}

// The drive of thesis (3-1): empty, straight there and back at constant speeds from a tenth to nine tenths of
// the limit, each held for two seconds or as long as the floor allows. Begins and ends at `pose`, facing the
// farthest wall's corner.
MissionScript plan_manoeuvre(const RobotParameters& robot, const ScriptOptions& options, ScriptPose& pose) {
  MissionScript script;
  const double reach_m = options.map_half_width_m - options.clearance_m;
  const double corner_x = pose.x_m > 0 ? -reach_m : reach_m;
  const double corner_y = pose.y_m > 0 ? -reach_m : reach_m;
  const double whole_m = std::hypot(corner_x - pose.x_m, corner_y - pose.y_m);
  const double rate = 0.6 * robot.yaw_rate_limit_rad_s;
  const double turning = 0.6 * robot.acceleration_limit_m_s2 / robot.half_track_m;
  const double acceleration = 0.6 * robot.acceleration_limit_m_s2;
  const double start_x = pose.x_m, start_y = pose.y_m;
  constexpr int steps = 9;
  constexpr double held_s = 2;
  for (int k = 1; k <= steps; ++k) {
    const double speed = 0.1 * k * robot.speed_limit_m_s;
    const double share = std::min(1.0, (speed * speed / acceleration + held_s * speed) / whole_m);
    const double x = start_x + share * (corner_x - start_x), y = start_y + share * (corner_y - start_y);
    script.legs.emplace_back(TurnTo{corner_x, corner_y, rate, turning});
    script.legs.emplace_back(GoTo{x, y, speed, acceleration});
    script.legs.emplace_back(Dwell{1});
    script.legs.emplace_back(TurnTo{start_x, start_y, rate, turning});
    script.legs.emplace_back(GoTo{start_x, start_y, speed, acceleration});
    script.legs.emplace_back(Dwell{1});
  }
  pose.heading_rad = std::atan2(start_y - corner_y, start_x - corner_x);
  return script;
}

}  // namespace

MissionScript plan_mission(const RobotParameters& robot, const ScriptOptions& options, ScriptPose& pose,
                           Rng& rng) {
  if (options.manoeuvre) return plan_manoeuvre(robot, options, pose);
  MissionScript script;
  script.payload_kg = draw_payload(robot, rng);
  if (options.undeclared_share > 0 && rng.chance(options.undeclared_share))
    script.undeclared_kg = robot.payload_limit_kg * options.undeclared_most * rng.uniform(0.25, 1);
  const double reach_m = options.map_half_width_m - options.clearance_m;
  const auto inside = [&](double x, double y) { return std::abs(x) <= reach_m && std::abs(y) <= reach_m; };
  double duration_s = 0;

  const auto go_somewhere = [&] {
    double x = 0;
    double y = 0;
    for (int k = 0; k < placement_tries; ++k) {
      x = rng.uniform(-reach_m, reach_m);
      y = rng.uniform(-reach_m, reach_m);
      const double d = std::hypot(x - pose.x_m, y - pose.y_m);
      if (d >= shortest_leg_m && d <= longest_leg_m) break;
    }
    const double heading = std::atan2(y - pose.y_m, x - pose.x_m);
    const double turn = std::remainder(heading - pose.heading_rad, 2 * std::numbers::pi);
    const double rate = robot.yaw_rate_limit_rad_s * rng.uniform(0.4, 0.9);
    // Yaw acceleration that accelerates the rim at most by the limit of straight driving.
    const double acceleration = robot.acceleration_limit_m_s2 / robot.half_track_m * rng.uniform(0.4, 0.95);
    script.legs.emplace_back(TurnTo{x, y, rate, acceleration});
    const Pace pace = draw_pace(robot, options, rng);
    script.legs.emplace_back(GoTo{x, y, pace.speed_m_s, pace.acceleration_m_s2});
    duration_s += Trapezoid(std::abs(turn), rate, acceleration).duration_s() +
                  Trapezoid(std::hypot(x - pose.x_m, y - pose.y_m), pace.speed_m_s, pace.acceleration_m_s2)
                      .duration_s();
    pose = {x, y, heading};
  };

  const auto try_arc = [&] {
    for (int k = 0; k < placement_tries; ++k) {
      const double radius = rng.uniform(0.8, 3.0);
      const double angle = rng.uniform(0.8, 2.8) * (rng.chance(0.5) ? 1 : -1);
      const double side = angle > 0 ? 1 : -1;
      const auto at = [&](double part) {
        const double h = pose.heading_rad + part * angle;
        return ScriptPose{pose.x_m + side * radius * (std::sin(h) - std::sin(pose.heading_rad)),
                          pose.y_m - side * radius * (std::cos(h) - std::cos(pose.heading_rad)), h};
      };
      const ScriptPose middle = at(0.5);
      const ScriptPose end = at(1);
      if (!inside(middle.x_m, middle.y_m) || !inside(end.x_m, end.y_m)) continue;
      Pace pace = draw_pace(robot, options, rng);
      pace.speed_m_s = std::min(pace.speed_m_s, 0.7 * robot.yaw_rate_limit_rad_s * radius);
      // The outer wheel keeps within the speed limit too.
      pace.speed_m_s =
          std::min(pace.speed_m_s, 0.95 * robot.speed_limit_m_s / (1 + robot.half_track_m / radius));
      script.legs.emplace_back(Arc{radius, angle, pace.speed_m_s, pace.acceleration_m_s2});
      duration_s += Trapezoid(radius * std::abs(angle), pace.speed_m_s, pace.acceleration_m_s2).duration_s();
      pose = end;
      return true;
    }
    return false;
  };

  while (duration_s < options.duration_s) {
    if (!rng.chance(options.arc_share) || !try_arc()) go_somewhere();
    if (rng.chance(options.dwell_share)) {
      const double halt_s = rng.uniform(options.shortest_halt_s, options.longest_halt_s);
      script.legs.emplace_back(Dwell{halt_s});
      duration_s += halt_s;
      if (rng.chance(options.pickup_share)) {
        script.legs.emplace_back(Load{draw_payload(robot, rng)});
        script.legs.emplace_back(Dwell{halt_s});
        duration_s += halt_s;
      }
    }
  }
  script.legs.emplace_back(Dwell{1.5});
  return script;
}

}  // namespace joulecast::virtual_robot
