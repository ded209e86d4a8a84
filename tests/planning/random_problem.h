#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "planning/path.h"
#include "planning/problem.h"
#include "tests/planning/robots.h"

namespace joulecast::planning::test {

struct RandomProblem {
  robot::RobotModel robot;
  std::vector<Segment> segments;
  PathOptions options;
  Problem problem;
  std::string label;
};

// One run on one of four robots: straight, turning, arc, mixed curvature, Bezier, Gaussian detour or
// clothoid; all regeneration fractions; limits of the robot file, tight, or absent; effects adopted on a
// third of them.
inline RandomProblem random_problem(std::uint64_t seed) {
  std::mt19937_64 random(seed * 7919 + 13);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  const auto pick = [&](int n) { return static_cast<int>(random() % static_cast<std::uint64_t>(n)); };
  RandomProblem p;
  p.robot = all_robots()[seed % 4];
  if (pick(4) == 0) p.robot.kinematics.com_offset_m = between(0.02, 0.1);
  p.options.payload_kg = pick(3) ? between(0, p.robot.limits.payload_kg) : 0;
  p.options.resolution_m = 0.05;
  p.options.start = {between(-5, 5), between(-5, 5), between(-3, 3)};
  const Pose start = p.options.start;
  const auto ahead = [&](double x, double y) {
    const double c = std::cos(start.heading_rad), s = std::sin(start.heading_rad);
    return Point{start.x_m + c * x - s * y, start.y_m + s * x + c * y};
  };
  switch (pick(8)) {
    case 0:
    case 1:
      p.segments = {Straight{std::exp(between(std::log(0.4), std::log(25)))}};
      p.label = "straight";
      break;
    case 2:
      p.segments = {TurnInPlace{(pick(2) ? 1 : -1) * between(0.3, 3.1)}};
      p.label = "turn";
      break;
    case 3:
      p.segments = {Arc{between(0.4, 4), (pick(2) ? 1 : -1) * between(0.5, 2.5)}};
      p.label = "arc";
      break;
    case 4:
      p.segments = {Straight{between(1, 4)}, Arc{between(0.8, 2), between(0.6, 2)}, Straight{between(1, 4)}};
      p.label = "straight-arc-straight";
      break;
    case 5: {
      const double l = between(3, 9), h = between(-2, 2);
      p.segments = {Bezier{ahead(l / 2, 0), ahead(l / 2, h), ahead(l, h)}};
      p.label = "bezier";
      break;
    }
    case 6: {
      const double l = between(6, 10);
      p.segments = {GaussianDetour{l, between(-1, 1), l / 2, l / 9}};
      p.label = "gaussian";
      break;
    }
    default:
      p.segments = {Clothoid{between(2, 8), between(-0.3, 0.3), between(-0.8, 0.8)}};
      p.label = "clothoid";
  }
  const double fractions[] = {1, 0.7, 0.3, 0, between(0, 1)};
  p.problem.regeneration = fractions[pick(5)];
  p.label += " regeneration " + std::to_string(*p.problem.regeneration);
  p.problem.limits = limits_of(p.robot);
  switch (pick(4)) {
    case 0:
      p.problem.limits = Limits{};
      p.label += " unlimited";
      break;
    case 1:
      p.problem.limits.speed_m_s *= between(0.3, 0.8);
      p.problem.limits.acceleration_m_s2 *= between(0.3, 0.8);
      p.label += " slow";
      break;
    case 2: {
      // Friction takes T/(K_t n); a motor that has little more accelerates slowly.
      const auto& m = p.robot.motor;
      const double kn = m.torque_constant_nm_a * m.gear_ratio;
      const double friction = std::max(m.friction_torque_nm[0], m.friction_torque_nm[1]) / kn;
      const double push =
          p.robot.total_mass_kg(p.options.payload_kg) * p.robot.kinematics.wheel_radius_m / 2 / kn;
      p.problem.limits.current_a = 1.6 * friction + 2 + push * between(0.1, 0.3);
      p.label += " weak";
      break;
    }
    default:
      break;
  }
  if (pick(2)) p.problem.value_of_time_w = between(0, 60);
  const bool driving = p.label.rfind("turn", 0) != 0;
  if (driving && pick(4) == 0) p.problem.start_speed_m_s = between(0.05, 0.2);
  if (driving && pick(4) == 0) p.problem.end_speed_m_s = between(0.05, 0.2);
  if (pick(3) == 0) {
    const auto adopt = [&](const char* id, std::vector<std::pair<std::string, double>> values) {
      p.robot.effects.push_back({id, std::move(values)});
      p.label += std::string(" ") + id;
    };
    switch (pick(8)) {
      case 0:
        adopt("turning_scrub", {{"coefficient", between(0.05, 0.3)}});
        break;
      case 1:
        adopt("aerodynamic_drag", {{"coefficient_n_s2_m2", between(0.5, 5)}});
        break;
      case 2:
        adopt("gear_efficiency", {{"loss", between(0.02, 0.2)}});
        break;
      case 3:
        adopt("stribeck_friction",
              {{"ratio", between(0.2, 1)}, {"speed_rad_s", between(0.5, 3)}, {"exponent", between(1, 2)}});
        break;
      case 4:
        adopt("driver_loss", {{"fraction", between(0.02, 0.1)}});
        break;
      case 5:
        adopt("brush_drop", {{"voltage_v", between(0.2, 1)}});
        break;
      case 6:
        adopt("slope", {{"angle_rad", between(0.003, 0.02)}, {"uphill_rad", between(-3, 3)}});
        break;
      default:
        adopt("load_rolling_resistance", {{"coefficient", between(0.005, 0.03)}});
    }
  }
  return p;
}

}  // namespace joulecast::planning::test
