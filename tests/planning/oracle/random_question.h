#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "planning/path.h"
#include "planning/problem.h"
#include "tests/planning/oracle/oracle.h"
#include "tests/planning/robots.h"

namespace joulecast::planning::test {

// The same question for planner and oracle.
struct Asked {
  robot::RobotModel robot;
  Path path;
  Problem problem;
  oracle::Question question;
  std::string label;
};

enum class Shape { straight, turn, arc, bend, clothoid };
enum class Tight { nothing, current, voltage, both };

inline void limit_motors(Asked& asked, Tight tight, double margin, double push_share) {
  const auto& m = asked.robot.motor;
  const double kn = m.torque_constant_nm_a * m.gear_ratio;
  const double friction = std::max(m.friction_torque_nm[0], m.friction_torque_nm[1]) / kn;
  const double push =
      asked.robot.total_mass_kg(asked.question.payload_kg) * asked.robot.kinematics.wheel_radius_m / 2 / kn;
  if (tight == Tight::current || tight == Tight::both)
    asked.problem.limits.current_a =
        margin * friction + push * push_share + m.viscous_friction_nm_s_rad * 4 / kn;
  if (tight == Tight::voltage || tight == Tight::both)
    asked.problem.limits.voltage_v *= 0.3 + 0.4 * push_share / 0.3;
}

inline Asked random_question(std::uint64_t seed) {
  std::mt19937_64 random(seed * 6364136223846793005u + 1442695040888963407u);
  random.discard(8);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  const auto one_of = [&](std::uint64_t n) { return random() % n; };
  Asked a;
  a.robot = all_robots()[one_of(4)];
  a.robot.idle_power_w *= between(0.3, 2);
  a.robot.motor.viscous_friction_nm_s_rad *= between(0.3, 2);
  for (double& friction : a.robot.motor.friction_torque_nm) friction *= between(0.5, 1.5);
  if (one_of(3) == 0) a.robot.kinematics.com_offset_m = between(0, 0.08);
  oracle::Question& q = a.question;
  q.payload_kg = one_of(3) ? between(0, a.robot.limits.payload_kg) : 0;
  const auto shape = static_cast<Shape>(one_of(5));
  Segment segment;
  switch (shape) {
    case Shape::straight:
      q.way.length = std::exp(between(std::log(0.3), std::log(20)));
      segment = Straight{q.way.length};
      a.label = "straight";
      break;
    case Shape::turn:
      q.way.turns_in_place = true;
      q.way.length = between(0.3, 3.1);
      segment = TurnInPlace{q.way.length};
      a.label = "turn";
      break;
    case Shape::arc: {
      const double radius = between(0.5, 4), angle = between(0.4, 2.5);
      q.way.length = radius * angle;
      q.way.at = {0}, q.way.curvature_1_m = {1 / radius};
      segment = Arc{radius, angle};
      a.label = "arc";
      break;
    }
    case Shape::bend: {
      SampledCurvature bend;
      double way = 0;
      for (int k = 0; k < 5; ++k) {
        bend.way_m.push_back(way);
        bend.curvature_1_m.push_back(k == 0 ? 0 : between(-1.2, 1.2));
        way += between(0.5, 2);
      }
      q.way.length = bend.way_m.back();
      q.way.at = bend.way_m, q.way.curvature_1_m = bend.curvature_1_m;
      segment = bend;
      a.label = "bend";
      break;
    }
    case Shape::clothoid: {
      const Clothoid c{between(1, 8), between(-0.3, 0.3), between(-0.8, 0.8)};
      q.way.length = c.length_m;
      q.way.at = {0, c.length_m}, q.way.curvature_1_m = {c.start_curvature_1_m, c.end_curvature_1_m};
      segment = c;
      a.label = "clothoid";
      break;
    }
  }
  a.path = *make_path(std::vector<Segment>{segment}, PathOptions{.start = {}, .payload_kg = q.payload_kg});
  a.problem.limits = limits_of(a.robot);
  const auto tight = static_cast<Tight>(one_of(4));
  limit_motors(a, tight, between(1.05, 1.3), between(0.04, 0.3));
  if (one_of(3) == 0) a.problem.limits.speed_m_s *= between(0.3, 0.8);
  if (one_of(3) == 0) a.problem.limits.acceleration_m_s2 *= between(0.3, 0.8);
  const double fractions[] = {1, 0.6, 0.3, 0};
  a.problem.regeneration = fractions[one_of(4)];
  if (one_of(2)) a.problem.value_of_time_w = between(0, 100);
  if (shape != Shape::turn && one_of(4) == 0) a.problem.start_speed_m_s = between(0.02, 0.2);
  if (shape != Shape::turn && one_of(4) == 0) a.problem.end_speed_m_s = between(0.02, 0.2);
  const char* names[] = {"", " current", " voltage", " current and voltage"};
  a.label = a.robot.robot_id + " " + a.label + names[static_cast<int>(tight)] + " regeneration " +
            std::to_string(*a.problem.regeneration).substr(0, 3);
  q.robot = a.robot;
  q.start_speed = a.problem.start_speed_m_s, q.end_speed = a.problem.end_speed_m_s;
  q.regeneration = *a.problem.regeneration;
  q.value_of_time_w = a.problem.value_of_time_w;
  const Limits& l = a.problem.limits;
  q.speed_m_s = l.speed_m_s, q.acceleration_m_s2 = l.acceleration_m_s2, q.yaw_rate_rad_s = l.yaw_rate_rad_s;
  q.current_a = l.current_a, q.voltage_v = l.voltage_v;
  return a;
}

// Likewise with an effect, twice and more of the acceleration, and curves so tight that the inner wheel
// reverses; from `first_of_gears` on with loss in the gear, before with one in the driver or scrub.
inline constexpr int first_of_gears = 2000;
inline Asked random_effect_question(std::uint64_t seed) {
  Asked a = random_question(seed);
  std::mt19937_64 random(seed * 2862933555777941757u + 3037000493u);
  random.discard(8);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  const auto one_of = [&](std::uint64_t n) { return random() % n; };
  oracle::Question& q = a.question;
  if (one_of(3) == 0) {
    q.start_speed = a.problem.start_speed_m_s = 0, q.end_speed = a.problem.end_speed_m_s = 0;
    const double tightest = between(0.5, 1.8) / a.robot.kinematics.half_track_m;
    const Clothoid c{between(0.6, 3), between(-0.5, 0.5), one_of(2) ? tightest : -tightest};
    q.way = {false, c.length_m, {0, c.length_m}, {c.start_curvature_1_m, c.end_curvature_1_m}};
    a.path = *make_path(std::vector<Segment>{c}, PathOptions{.start = {}, .payload_kg = q.payload_kg});
    a.label += " tight clothoid";
  }
  if (one_of(2)) q.acceleration_m_s2 = a.problem.limits.acceleration_m_s2 *= between(1.5, 6);
  const auto adopt = [&](const char* id, std::vector<std::pair<std::string, double>> values) {
    a.robot.effects.push_back({id, std::move(values)});
    a.label += std::string(" ") + id;
  };
  if (seed >= first_of_gears) {
    q.gear_loss = between(0.02, 0.4), q.gear_of_friction = between(0, 1);
    adopt("gear_efficiency", {{"loss", q.gear_loss}, {"of_friction", q.gear_of_friction}});
  } else if (one_of(3) > 0) {
    q.driver_loss = between(0.02, 0.1);
    adopt("driver_loss", {{"fraction", q.driver_loss}});
  } else {
    q.scrub = between(0.05, 0.3), q.scrub_rate_rad_s = std::exp(between(std::log(0.02), std::log(0.7)));
    adopt("turning_scrub", {{"coefficient", q.scrub}, {"rate_rad_s", q.scrub_rate_rad_s}});
  }
  if (one_of(2)) q.regeneration = 0, a.problem.regeneration = 0;
  a.label += " now " + std::to_string(q.regeneration).substr(0, 3);
  return a;
}

}  // namespace joulecast::planning::test
