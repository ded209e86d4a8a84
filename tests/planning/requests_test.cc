// Any valid robot and request give a plan, or a refusal that names the field. Never an internal error.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <random>

#include "planning/planner.h"
#include "robot/robot_file.h"
#include "tests/planning/robots.h"

namespace joulecast::planning {
namespace {

class Chance {
 public:
  explicit Chance(std::uint64_t seed) : random_(seed) {}
  double between(double a, double b) { return std::uniform_real_distribution(a, b)(random_); }
  double scale(double a, double b) { return std::exp(between(std::log(a), std::log(b))); }
  bool once_in(std::uint64_t n) { return random_() % n == 0; }
  std::size_t below(std::size_t n) { return random_() % n; }

 private:
  std::mt19937_64 random_;
};

robot::RobotModel a_robot(Chance& chance) {
  robot::RobotModel r = test::all_robots()[chance.below(4)];
  r.motor.gear_ratio *= chance.once_in(3) ? chance.scale(0.02, 100) : 1;
  r.motor.resistance_ohm *= chance.scale(0.1, 20);
  r.motor.torque_constant_nm_a *= chance.scale(0.5, 1.5);
  r.motor.viscous_friction_nm_s_rad *= chance.once_in(4) ? 0 : chance.scale(0.01, 100);
  for (double& friction : r.motor.friction_torque_nm)
    friction *= chance.once_in(4) ? 0 : chance.scale(0.01, 10);
  r.mass.chassis_kg *= chance.scale(0.1, 10);
  r.mass.yaw_inertia_kg_m2 *= chance.scale(0.1, 10);
  if (chance.once_in(3)) r.kinematics.com_offset_m = chance.between(-0.2, 0.3);
  r.idle_power_w *= chance.once_in(4) ? 0 : chance.scale(0.01, 10);
  r.battery.nominal_voltage_v *= chance.scale(0.3, 5);
  r.limits.speed_m_s *= chance.scale(0.05, 5);
  r.limits.acceleration_m_s2 *= chance.scale(0.02, 10);
  r.limits.yaw_rate_rad_s *= chance.scale(0.05, 5);
  r.limits.current_a = chance.once_in(4) ? 0 : r.limits.current_a * chance.scale(0.01, 2);
  switch (chance.below(8)) {
    case 0:
      r.effects = {
          {"gear_efficiency", {{"loss", chance.between(0, 0.6)}, {"of_friction", chance.between(0, 1)}}}};
      break;
    case 1:
      r.effects = {
          {"stribeck_friction",
           {{"ratio", chance.between(0, 5)}, {"speed_rad_s", chance.scale(0.2, 10)}, {"exponent", 2.0}}}};
      break;
    case 2:
      r.effects = {{"aerodynamic_drag", {{"coefficient_n_s2_m2", chance.scale(0.1, 20)}}},
                   {"brush_drop", {{"voltage_v", chance.between(0, 2)}}}};
      break;
    case 3:
      r.effects = {{"slope", {{"angle_rad", chance.between(0, 0.1)}, {"uphill_rad", chance.between(-3, 3)}}}};
      break;
    default:
      break;
  }
  return r;
}

std::vector<Segment> a_path(Chance& chance) {
  const double length = chance.scale(1e-3, 200);
  switch (chance.below(6)) {
    case 0:
      return {TurnInPlace{chance.between(-6, 6)}};
    case 1:
      return {Arc{chance.scale(0.05, 20), chance.between(0.1, 3)}};
    case 2:
      return {Clothoid{chance.scale(0.2, 20), chance.between(-2, 2), chance.between(-2, 2)}};
    case 3:
      return {Straight{length}, TurnInPlace{chance.between(-3, 3)}, Straight{chance.scale(0.01, 5)}};
    default:
      return {Straight{length}};
  }
}

Problem a_problem(Chance& chance, const robot::RobotModel& robot) {
  Problem p;
  p.limits = limits_of(robot);
  p.rows = chance.once_in(2);
  const double fractions[] = {1, 0.5, 0, 0.999};
  if (chance.once_in(2)) p.regeneration = fractions[chance.below(4)];
  if (chance.once_in(3)) p.value_of_time_w = chance.scale(1e-3, 1e4);
  if (chance.once_in(4)) p.start_speed_m_s = chance.between(0, robot.limits.speed_m_s);
  if (chance.once_in(4)) p.end_speed_m_s = chance.between(0, robot.limits.speed_m_s);
  return p;
}

class AnyRequest : public ::testing::TestWithParam<int> {};

void expect_no_internal_error(const Result<Plan>& answer) {
  if (answer) {
    EXPECT_TRUE(std::isfinite(answer->summary.energy_j));
    EXPECT_GE(answer->summary.duration_s, 0);
    EXPECT_NEAR(answer->ledger.total(), answer->summary.energy_j,
                1e-6 * (std::fabs(answer->summary.energy_j) + answer->summary.braking_j));
    return;
  }
  EXPECT_NE(answer.error().fault, Fault::internal) << describe(answer.error());
  EXPECT_FALSE(answer.error().field.empty()) << describe(answer.error());
}

TEST_P(AnyRequest, IsAnsweredOrClearlyRefused) {
  for (int i = 0; i < 60; ++i) {
    Chance chance(static_cast<std::uint64_t>(1000 * GetParam() + i));
    const robot::RobotModel robot = a_robot(chance);
    if (!robot::validate(robot)) continue;
    SCOPED_TRACE(std::to_string(1000 * GetParam() + i));
    const auto path = make_path(
        a_path(chance), PathOptions{.start = {}, .payload_kg = chance.between(0, robot.limits.payload_kg)});
    ASSERT_TRUE(path) << describe(path.error());
    Problem problem = a_problem(chance, robot);
    const auto began = std::chrono::steady_clock::now();
    const auto answer = plan(robot, *path, problem);
    expect_no_internal_error(answer);
    if (!answer) {
      problem.deadline_s = chance.scale(1, 1e4);
      expect_no_internal_error(plan(robot, *path, problem));
    } else {
      const double shortest = answer->certificate.shortest_time_s;
      for (const double later : {0.0, 1e-4, 0.1}) {
        problem.deadline_s = shortest * (1 + later);
        const auto hurried = plan(robot, *path, problem);
        expect_no_internal_error(hurried);
      }
    }
    EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count(), 60);
  }
}

INSTANTIATE_TEST_SUITE_P(OfManyRobots, AnyRequest, ::testing::Range(0, 10));

}  // namespace
}  // namespace joulecast::planning
