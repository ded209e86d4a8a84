// Plans with binding current, voltage or acceleration limits, or without regenerative braking, compared with
// direct transcription.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "planning/load.h"
#include "planning/planner.h"
#include "tests/planning/robots.h"
#include "tests/planning/transcription.h"

namespace joulecast::planning {
namespace {

struct LimitedProblem {
  robot::RobotModel robot;
  Path path;
  Problem problem;
  std::string label;
};

LimitedProblem limited_problem(std::uint64_t seed) {
  std::mt19937_64 random(seed * 104729 + 7);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  LimitedProblem p;
  p.robot = test::all_robots()[seed % 4];
  const double payload = between(0, p.robot.limits.payload_kg);
  const int kind = static_cast<int>(random() % 4);
  std::vector<Segment> segments{Straight{std::exp(between(std::log(0.5), std::log(12)))}};
  if (kind == 2) segments = {TurnInPlace{between(0.5, 3)}};
  if (kind == 3) segments = {Arc{between(0.6, 3), between(0.6, 2)}};
  p.path = *make_path(segments, PathOptions{.start = {}, .payload_kg = payload});
  p.problem.limits = limits_of(p.robot);
  const double fractions[] = {1, 0.4, 0};
  p.problem.regeneration = fractions[random() % 3];
  const auto& m = p.robot.motor;
  const double kn = m.torque_constant_nm_a * m.gear_ratio;
  const double friction = std::max(m.friction_torque_nm[0], m.friction_torque_nm[1]) / kn;
  const double push = p.robot.total_mass_kg(payload) * p.robot.kinematics.wheel_radius_m / 2 / kn;
  const int limit = static_cast<int>(random() % 3);
  if (limit == 0)
    p.problem.limits.current_a =
        1.05 * friction + push * between(0.05, 0.3) + m.viscous_friction_nm_s_rad * 4 / kn;
  if (limit == 1) p.problem.limits.voltage_v *= between(0.3, 0.7);
  p.problem.value_of_time_w = random() % 2 ? between(0, 100) : 0;
  p.label = p.robot.robot_id +
            (kind == 2   ? " turn"
             : kind == 3 ? " arc"
                         : " straight") +
            " limit " + std::to_string(limit);
  return p;
}

// Steps of curvature on an incline, between segments of 0.4 m and more: half of the 0.2 m in which the
// curvature then changes, as the HTTP document states, lies on each side of a joint.
struct Joint {
  double straight_m, radius_m, angle_rad;
  double tilt_rad, uphill_rad;

  std::array<double, 4> ways() const {  // where the curvature begins and ends to change
    const double arc = radius_m * angle_rad;
    return {straight_m - 0.1, straight_m + 0.1, straight_m + arc - 0.1, straight_m + arc + 0.1};
  }
  double slope(double way) const {
    const auto w = ways();
    return way > w[0] && way < w[1] ? 5 / radius_m : way > w[2] && way < w[3] ? -5 / radius_m : 0;
  }
  // Integrals of the slope: curvature and heading.
  double bend(double way, int times) const {
    double sum = 0;
    const auto w = ways();
    for (std::size_t k = 0; k < 4; ++k)
      sum += (k == 0 || k == 3 ? 5 : -5) / radius_m * std::pow(std::max(0.0, way - w[k]), times) / times;
    return sum;
  }
  double voltage(const robot::RobotModel& r, double payload_kg, double way, double v, double a) const {
    const double radius = r.kinematics.wheel_radius_m, l = r.kinematics.half_track_m;
    const double mass = r.mass.chassis_kg + 2 * r.mass.wheel_kg + payload_kg;
    const double yaw_inertia = r.mass.yaw_inertia_kg_m2 + 0.02 * payload_kg;
    const double constant = r.motor.torque_constant_nm_a * r.motor.gear_ratio;
    const double curvature = bend(way, 1), yaw_slope = curvature * a + slope(way) * v * v;
    const double force = mass * (a + 9.80665 * std::sin(tilt_rad) * std::cos(bend(way, 2) - uphill_rad));
    double most = 0;
    for (const std::size_t s : {0u, 1u}) {
      const double sign = s == 0 ? 1 : -1;
      const double w = v * (1 + sign * l * curvature) / radius;
      const double torque =
          0.5 * radius * (force + sign * yaw_inertia * yaw_slope / l) +
          (r.mass.wheel_inertia_kg_m2 + r.motor.rotor_inertia_kg_m2) * (a + sign * l * yaw_slope) / radius +
          r.motor.viscous_friction_nm_s_rad * w + std::copysign(r.motor.friction_torque_nm[s], w);
      most = std::max(most, std::fabs(r.motor.resistance_ohm * torque / constant +
                                      r.motor.voltage_constant_v_s_rad * r.motor.gear_ratio * w));
    }
    return most;
  }
};

// Played with the speed linear in time between its rows, also at both sides of every joint.
TEST(JointsOnSlopes, KeepTheirVoltageLimit) {
  std::mt19937_64 random(36);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  int bound = 0;
  for (int k = 0; k < 60; ++k) {
    robot::RobotModel robot = test::all_robots()[static_cast<std::size_t>(k % 4)];
    const Joint joint{between(0.5, 4), between(0.5, 3), between(0.8, 2), between(0.01, 0.08), between(-3, 3)};
    robot.effects.push_back({"slope", {{"angle_rad", joint.tilt_rad}, {"uphill_rad", joint.uphill_rad}}});
    const double payload = between(0, robot.limits.payload_kg);
    const auto path = make_path(
        std::vector<Segment>{Straight{joint.straight_m}, Arc{joint.radius_m, joint.angle_rad}, Straight{2}},
        PathOptions{.start = {}, .payload_kg = payload});
    ASSERT_TRUE(path);
    Problem problem;
    problem.limits = limits_of(robot);
    problem.limits.voltage_v *= between(0.35, 0.7);
    problem.limits.current_a = std::numeric_limits<double>::infinity();
    problem.value_of_time_w = k % 2 ? between(0, 300) : 0;
    auto plan = planning::plan(robot, *path, problem);
    if (!plan && plan.error().fault == Fault::infeasible) continue;
    ASSERT_TRUE(plan) << describe(plan.error());
    for (const bool hurried : {false, true}) {
      if (hurried) {
        problem.deadline_s = plan->certificate.shortest_time_s * 1.001;
        plan = planning::plan(robot, *path, problem);
        ASSERT_TRUE(plan) << describe(plan.error());
      }
      const Profile& rows = plan->profile;
      double most = 0, where = 0;
      for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
        const double span = rows.time_s[i + 1] - rows.time_s[i];
        const double a = (rows.speed_m_s[i + 1] - rows.speed_m_s[i]) / span;
        for (const double f : {1e-6, 0.25, 0.5, 0.75, 1 - 1e-6}) {
          const double t = f * span, way = rows.distance_m[i] + (rows.speed_m_s[i] + 0.5 * a * t) * t;
          const double volts = joint.voltage(robot, payload, way, rows.speed_m_s[i] + a * t, a);
          if (volts > most) most = volts, where = way;
        }
      }
      EXPECT_LT(most, problem.limits.voltage_v * (1 + 5e-5)) << k << " at " << where;
      bound += most > 0.999 * problem.limits.voltage_v;
    }
  }
  EXPECT_GT(bound, 20);
}

class LimitedProblems : public ::testing::TestWithParam<int> {};

TEST_P(LimitedProblems, PlansAndCertificatesAreRight) {
  const LimitedProblem p = limited_problem(static_cast<std::uint64_t>(GetParam()));
  SCOPED_TRACE(p.label);
  const auto planner = Planner::make(p.robot, p.problem.regeneration);
  ASSERT_TRUE(planner);
  const planning::Run& run = p.path.runs[0];
  const auto free = planner->plan(p.path, p.problem);
  ASSERT_TRUE(free) << describe(free.error());
  const double shortest = free->certificate.shortest_time_s;
  EXPECT_NEAR(shortest, test::least_time_s(p.robot, planner->loads().model(), run, p.problem.limits),
              3e-4 * shortest);
  // Every deadline from the shortest time on is met.
  for (const double share : {0.0, 1e-5, 1e-3, 0.03, 0.5}) {
    Problem hurried = p.problem;
    hurried.deadline_s = shortest + share * (free->summary.duration_s - shortest) + 1e-9;
    const auto plan = planner->plan(p.path, hurried);
    ASSERT_TRUE(plan) << share << ": " << describe(plan.error());
    EXPECT_LE(plan->summary.duration_s, *hurried.deadline_s * (1 + 1e-9));
    EXPECT_GE(plan->summary.energy_j,
              free->summary.energy_j * (1 - 8e-4) -
                  p.problem.value_of_time_w * (free->summary.duration_s - *hurried.deadline_s));
  }
  for (const double share : {1.0, 0.1}) {
    Problem hurried = p.problem;
    if (share < 1) hurried.deadline_s = shortest + share * (free->summary.duration_s - shortest);
    const auto plan = share < 1 ? planner->plan(p.path, hurried) : free;
    ASSERT_TRUE(plan) << describe(plan.error());
    const double price = share < 1 ? plan->certificate.time_multiplier_w : p.problem.value_of_time_w;
    const double cost = plan->summary.energy_j + price * plan->summary.duration_s;
    const auto best =
        test::transcribed(p.robot, planner->loads().model(), run, p.problem.limits, 0, 0, price, 120);
    const Certificate& c = plan->certificate;
    if (best.excess > 5e-3) continue;  // the transcription did not converge
    // The transcription may cost less because of its excess over the limits, and because of its own cells.
    const double own = (2e-4 + 0.3 * best.excess) * best.cost_j;
    EXPECT_LT(cost, best.cost_j + c.gap_j + c.discretisation_j + own) << share;
    EXPECT_GT(cost, best.cost_j * (1 - 0.01)) << share;
    EXPECT_LT(c.gap_j + c.discretisation_j, 5e-4 * cost);
  }
}

// Costs that IPOPT found for a transcription with 300 cells by code of its own, limits kept at every cell's
// ends: the optimum is not above them.
struct Found {
  const char* label;
  robot::RobotModel robot;
  Segment segment;
  double payload_kg, end_speed_m_s, value_of_time_w, cost_j;
};

robot::RobotModel small_robot(double current_a) {
  robot::RobotModel r;
  r.kinematics = {0.095, 0.165, 0};
  r.mass = {6.04, 1.48, 0.25, 0};
  r.motor = {0.7, 0.0007, 0.88, 0.88, 1, 0.0713, 0.039, {0, 0}};
  r.battery.nominal_voltage_v = 12.6;
  r.idle_power_w = 6;
  r.limits = {1.21, 0.5, 2.0, current_a, 7.6};
  return r;
}

TEST(Limited, CostsNoMoreThanExternalSolutions) {
  robot::RobotModel husky;
  husky.kinematics = {0.1651, 0.2775, 0};
  husky.mass = {45, 5, 4.5, 0.14};
  husky.motor = {0.5638177040327738,
                 0,
                 0.0445,
                 0.0445,
                 79,
                 0.3,
                 0.3656618334599215,
                 {1.7465258089244993, 6.153505316111003}};
  husky.battery.nominal_voltage_v = 24;
  husky.idle_power_w = 74.49969075041963;
  husky.limits = {1, 1, 2, 2.687276324210236, 75};
  robot::RobotModel lossy = small_robot(0.21009445300006452);
  lossy.effects = {{"no_regeneration", {{"fraction", 1.0}}}};
  for (const Found& f :
       {Found{"straight, no regeneration", lossy, Straight{2.379181799515453}, 0, 0, 0, 62.3985},
        {"straight, high value of time", husky, Straight{3.180264367278835}, 2.386986224355134, 0,
         62.08576509084941, 627.265 + 62.08576509084941 * 5.2082},
        {"turn", small_robot(0.23089633903750997), TurnInPlace{1.2844687099238992}, 4.521179818919879, 0, 0,
         14.7623}}) {
    const auto path =
        make_path(std::vector<Segment>{f.segment}, PathOptions{.start = {}, .payload_kg = f.payload_kg});
    Problem problem;
    problem.limits = limits_of(f.robot);
    problem.value_of_time_w = f.value_of_time_w;
    const auto answer = plan(f.robot, *path, problem);
    ASSERT_TRUE(answer) << describe(answer.error());
    const double cost = answer->summary.energy_j + f.value_of_time_w * answer->summary.duration_s;
    EXPECT_LT(cost, f.cost_j * (1 + 5e-4)) << f.label;
    EXPECT_GT(cost, f.cost_j * (1 - 5e-3)) << f.label;
  }
}

// With a current just above the friction's, the current left for acceleration vanishes towards the top speed.
// No deadline makes a plan cheaper than it is in free time, and rows keep the limit.
TEST(Limited, UsesCurrentJustAboveFriction) {
  for (const robot::RobotModel& whole : test::all_robots()) {
    const auto& m = whole.motor;
    const double friction_a =
        std::max(m.friction_torque_nm[0], m.friction_torque_nm[1]) / (m.torque_constant_nm_a * m.gear_ratio);
    if (!(friction_a > 0)) continue;
    const auto planner = Planner::make(whole);
    ASSERT_TRUE(planner);
    for (const double above : {1.004, 1.02, 1.05, 1.1}) {
      for (const Segment& segment : {Segment{Straight{3}}, Segment{Straight{40}}, Segment{TurnInPlace{2}}}) {
        const auto path = make_path(std::vector<Segment>{segment}, {});
        Problem problem;
        problem.limits = limits_of(whole);
        problem.limits.current_a = above * friction_a;
        const auto free = planner->plan(*path, problem);
        ASSERT_TRUE(free) << describe(free.error());
        const double shortest = free->certificate.shortest_time_s;
        const std::string label = whole.robot_id + " " + std::to_string(above) + " over " +
                                  std::to_string(path->distance_m() + path->turned_rad());
        for (const double longer : {1.0001, 1.002, 1.05}) {
          Problem hurried = problem;
          hurried.deadline_s = longer * shortest;
          const auto plan = planner->plan(*path, hurried);
          ASSERT_TRUE(plan) << label << describe(plan.error());
          EXPECT_LT(free->summary.energy_j, plan->summary.energy_j * (1 + 1e-4)) << label << " " << longer;
        }
      }
    }
  }
}

// The fastest motion takes several times the least energy; the certificate still bounds the possible saving.
// Where braking costs, power is not convex in the acceleration: weaker motors or softer ramps are never an
// advantage.
TEST(Limited, TighterLimitsCostMore) {
  for (robot::RobotModel robot : test::all_robots()) {
    robot.effects.push_back({"driver_loss", {{"fraction", 0.08}}});
    robot.limits.acceleration_m_s2 *= 5;
    const auto planner = Planner::make(robot, 0.0);
    ASSERT_TRUE(planner);
    for (const Segment& segment :
         {Segment{Straight{0.3}}, Segment{Straight{3}}, Segment{TurnInPlace{2}}, Segment{Arc{0.5, 0.4}},
          Segment{Clothoid{1, 0.2, 1.5}}, Segment{Clothoid{0.5, 0, 3}}}) {
      const auto path = make_path(std::vector<Segment>{segment}, PathOptions{.start = {}, .payload_kg = 1});
      for (const double times_idle : {0.0, 1.0, 20.0}) {
        Problem problem;
        problem.limits = limits_of(robot);
        problem.value_of_time_w = times_idle * robot.idle_power_w;
        double before = 0;
        for (const double share : {1.0, 0.6, 0.4, 0.25, 0.15, 0.1}) {
          Problem tighter = problem;
          tighter.limits.current_a *= share;
          tighter.limits.acceleration_m_s2 *= share;
          const auto cost = planner->cost(*path, tighter);
          if (!cost) break;
          const double cost_j = cost->energy_j + problem.value_of_time_w * cost->duration_s;
          EXPECT_GT(cost_j, before * (1 - 5e-4)) << robot.robot_id << " segment " << segment.index()
                                                 << " price " << times_idle << " share " << share;
          before = std::max(before, cost_j);
        }
      }
    }
  }
}

TEST(Limited, FastestPlanHasTightCertificate) {
  robot::RobotModel robot = test::amr();
  robot.limits.acceleration_m_s2 = 4;
  robot.limits.current_a = 0;
  const auto path = make_path(std::vector<Segment>{Straight{5}}, {});
  Problem problem;
  problem.limits = limits_of(robot);
  const auto free = plan(robot, *path, problem);
  ASSERT_TRUE(free) << describe(free.error());
  problem.deadline_s = free->certificate.shortest_time_s;
  const auto fastest = plan(robot, *path, problem);
  ASSERT_TRUE(fastest) << describe(fastest.error());
  EXPECT_GT(fastest->summary.energy_j, 1.05 * free->summary.energy_j);
  EXPECT_LT(fastest->certificate.gap_j, 0.01 * fastest->summary.energy_j);
}

INSTANTIATE_TEST_SUITE_P(EightProblems, LimitedProblems, ::testing::Range(0, 8));
INSTANTIATE_TEST_SUITE_P(LongRest, LimitedProblems, ::testing::Range(8, 12));

}  // namespace
}  // namespace joulecast::planning
