// Plans under every kind of limit against a transcription of another hand, solved by IPOPT.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "planning/planner.h"
#include "tests/planning/oracle/random_question.h"

namespace joulecast::planning {
namespace {

// Cost of the optimum: limits of motors at the middles of cells, with an error of second order in the cell.
constexpr int cells = 240;
constexpr double of_the_oracle = 6e-5;  // its own error, of the cost

double bounds_of(const Certificate& c) {
  return c.gap_j + c.discretisation_j;
}

// The greatest use of any limit of a motor between the rows, played with the speed linear in time.
double greatest_use(const test::Asked& asked, const Profile& rows) {
  const bool turn = asked.question.way.turns_in_place;
  const std::vector<double>&speed = turn ? rows.yaw_rate_rad_s : rows.speed_m_s,
        &way = turn ? rows.heading_rad : rows.distance_m;
  double most = 0;
  for (std::size_t k = 0; k + 1 < rows.size(); ++k) {
    const double span = rows.time_s[k + 1] - rows.time_s[k], slope = (speed[k + 1] - speed[k]) / span;
    for (const double f : {1e-6, 0.25, 0.5, 0.75, 1 - 1e-6}) {
      const double t = f * span;
      const oracle::Drive d = oracle::drive_at(asked.question, way[k] + (speed[k] + 0.5 * slope * t) * t,
                                               speed[k] + slope * t, slope);
      for (const int s : {0, 1})
        most = std::max({most, std::fabs(d.current_a[s]) / asked.question.current_a,
                         std::fabs(d.voltage_v[s]) / asked.question.voltage_v});
    }
  }
  return most;
}

class AgainstIpopt : public ::testing::TestWithParam<int> {};

TEST_P(AgainstIpopt, PlansAreOptimalWithinLimits) {
  test::Asked asked = test::random_question(static_cast<std::uint64_t>(GetParam()));
  SCOPED_TRACE(asked.label);
  asked.question.cells = cells;
  asked.question.strict = false;
  const auto planner = Planner::make(asked.robot, asked.problem.regeneration);
  ASSERT_TRUE(planner);
  const auto free = planner->plan(asked.path, asked.problem);
  ASSERT_TRUE(free) << describe(free.error());
  EXPECT_LT(greatest_use(asked, free->profile), 1 + 5e-5);
  const double price = asked.problem.value_of_time_w;
  const double cost = free->summary.energy_j + price * free->summary.duration_s;
  const oracle::Found best = oracle::least_energy(asked.question);
  ASSERT_TRUE(best.solved);
  EXPECT_NEAR(cost, best.cost_j, 1e-3 * best.cost_j);
  EXPECT_LT(cost - bounds_of(free->certificate), best.cost_j * (1 + of_the_oracle));

  // Half of the time that can be saved.
  const double shortest = free->certificate.shortest_time_s;
  asked.problem.deadline_s = shortest + 0.5 * (free->summary.duration_s - shortest);
  asked.question.deadline_s = asked.problem.deadline_s;
  const auto hurried = planner->plan(asked.path, asked.problem);
  ASSERT_TRUE(hurried) << describe(hurried.error());
  EXPECT_LE(hurried->summary.duration_s, *asked.problem.deadline_s * (1 + 1e-9));
  EXPECT_LT(greatest_use(asked, hurried->profile), 1 + 5e-5);
  // IPOPT does not find every motion in so short a time.
  if (const oracle::Found soon = oracle::least_energy(asked.question); soon.solved) {
    EXPECT_NEAR(hurried->summary.energy_j, soon.energy_j, 1e-3 * soon.energy_j);
    EXPECT_LT(hurried->summary.energy_j - bounds_of(hurried->certificate),
              soon.energy_j * (1 + of_the_oracle));
  }
}

TEST_P(AgainstIpopt, ShortestTimeIsExactAndFeasible) {
  test::Asked asked = test::random_question(static_cast<std::uint64_t>(GetParam()));
  SCOPED_TRACE(asked.label);
  const auto free = plan(asked.robot, asked.path, asked.problem);
  ASSERT_TRUE(free) << describe(free.error());
  const double shortest = free->certificate.shortest_time_s;
  asked.question.cells = 3 * cells;
  asked.question.strict = false;
  asked.question.fastest = true;
  if (const oracle::Found soonest = oracle::least_energy(asked.question); soonest.solved) {
    EXPECT_NEAR(shortest, soonest.duration_s, 1e-4 * soonest.duration_s);
  }
  for (const double later : {0.0, 1e-7, 1e-5, 1e-3}) {
    asked.problem.deadline_s = shortest * (1 + later);
    const auto answer = plan(asked.robot, asked.path, asked.problem);
    ASSERT_TRUE(answer) << later << ": " << describe(answer.error());
    EXPECT_LE(answer->summary.duration_s, *asked.problem.deadline_s * (1 + 1e-7));
    EXPECT_LT(greatest_use(asked, answer->profile), 1 + 5e-5) << later;
  }
}

// The cheapest that IPOPT finds from two beginnings and from the plan itself.
double oracle_cost(oracle::Question asked, const Profile& rows) {
  const bool turn = asked.way.turns_in_place;
  oracle::Found plan;
  plan.way = turn ? rows.heading_rad : rows.distance_m;
  plan.speed = turn ? rows.yaw_rate_rad_s : rows.speed_m_s;
  plan.duration_s = rows.time_s.back();
  double best = std::numeric_limits<double>::infinity();
  const auto take = [&](const oracle::Found& found) {
    if (found.solved) best = std::min(best, found.cost_j);
  };
  take(oracle::least_energy(asked, plan));
  for (const double gentle : {0.1, 0.7}) asked.gentle = gentle, take(oracle::least_energy(asked));
  return best;
}

class EffectsAgainstIpopt : public ::testing::TestWithParam<int> {};

// Power is not convex with these effects, and inner wheels reverse.
TEST_P(EffectsAgainstIpopt, PlansAreOptimalWithinLimits) {
  test::Asked asked = test::random_effect_question(static_cast<std::uint64_t>(GetParam()));
  SCOPED_TRACE(asked.label);
  asked.question.cells = 110;  // a motion that can be driven
  const auto planner = Planner::make(asked.robot, asked.problem.regeneration);
  ASSERT_TRUE(planner);
  const auto compare = [&](const Plan& plan) {
    EXPECT_LT(greatest_use(asked, plan.profile), 1 + 2e-4);
    const double cost = plan.summary.energy_j + asked.question.value_of_time_w * plan.summary.duration_s;
    EXPECT_LT(cost, oracle_cost(asked.question, plan.profile) * (1 + 1e-3));
  };
  const auto free = planner->plan(asked.path, asked.problem);
  if (!free && free.error().fault == Fault::infeasible) GTEST_SKIP() << describe(free.error());
  ASSERT_TRUE(free) << describe(free.error());
  compare(*free);
  const double shortest = free->certificate.shortest_time_s;
  asked.problem.deadline_s = shortest + 0.4 * (free->summary.duration_s - shortest);
  asked.question.deadline_s = asked.problem.deadline_s;
  asked.question.value_of_time_w = 0;
  const auto hurried = planner->plan(asked.path, asked.problem);
  ASSERT_TRUE(hurried) << describe(hurried.error());
  compare(*hurried);
}

// A robot of the same proportions in energy, as heavy as a toy or a carrier of 2 t, that begins at speed.
test::Asked resized_question(std::uint64_t seed) {
  test::Asked a = test::random_question(seed);
  std::mt19937_64 random(seed * 2862933555777941757u + 36);
  random.discard(8);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  const double mass = a.robot.total_mass_kg(0),
               size = std::exp(between(std::log(0.4), std::log(2000))) / mass;
  robot::RobotModel& r = a.robot;
  for (double* by_mass :
       {&r.mass.chassis_kg, &r.mass.wheel_kg, &r.mass.yaw_inertia_kg_m2, &r.mass.wheel_inertia_kg_m2,
        &r.motor.rotor_inertia_kg_m2, &r.motor.viscous_friction_nm_s_rad, &r.motor.friction_torque_nm[0],
        &r.motor.friction_torque_nm[1], &r.idle_power_w, &r.limits.payload_kg, &a.question.payload_kg,
        &a.question.value_of_time_w, &a.problem.value_of_time_w})
    *by_mass *= size;
  for (double* by_root : {&r.motor.torque_constant_nm_a, &r.motor.voltage_constant_v_s_rad,
                          &r.limits.current_a, &r.battery.nominal_voltage_v, &a.problem.limits.current_a,
                          &a.problem.limits.voltage_v, &a.question.current_a, &a.question.voltage_v})
    *by_root *= std::sqrt(size);
  for (planning::Run& run : a.path.runs) run.payload_kg = a.question.payload_kg;
  a.question.robot = r;
  double bend = 0;
  for (const double curvature : a.question.way.curvature_1_m) bend = std::max(bend, std::fabs(curvature));
  const double fastest = std::min(a.question.speed_m_s, a.question.yaw_rate_rad_s / std::max(bend, 1e-9));
  if (!a.question.way.turns_in_place)
    a.question.start_speed = a.problem.start_speed_m_s = between(0, 0.95) * fastest;
  a.label += " " + std::to_string(size * mass) + " kg at " + std::to_string(a.question.start_speed) + " m/s";
  return a;
}

class AnySize : public ::testing::TestWithParam<int> {};

TEST_P(AnySize, PlansFromSpeedAreOptimal) {
  test::Asked asked = resized_question(static_cast<std::uint64_t>(GetParam()));
  SCOPED_TRACE(asked.label);
  asked.question.cells = cells;
  asked.question.strict = false;
  const auto plan = planning::plan(asked.robot, asked.path, asked.problem);
  const oracle::Found best = oracle::least_energy(asked.question);
  ASSERT_EQ(plan.has_value(), best.solved) << (plan ? "" : describe(plan.error()));
  if (!plan) return;
  EXPECT_LT(greatest_use(asked, plan->profile), 1 + 5e-5);
  const double cost = plan->summary.energy_j + asked.problem.value_of_time_w * plan->summary.duration_s;
  // Energy that braking returns makes costs small beside what flows.
  EXPECT_NEAR(cost, best.cost_j, 1e-3 * std::fabs(best.cost_j));
  EXPECT_LT(cost - bounds_of(plan->certificate), best.cost_j + of_the_oracle * std::fabs(best.cost_j));
}

// The inner wheel of a clothoid reverses: its dry friction jumps, at a current limit just above it.
TEST(ReversingWheel, KeepsItsCurrentLimit) {
  const test::Asked asked = test::random_effect_question(1038);
  const auto plan = planning::plan(asked.robot, asked.path, asked.problem);
  ASSERT_TRUE(plan) << describe(plan.error());
  EXPECT_LT(greatest_use(asked, plan->profile), 1 + 2e-4);
}

// Between the knots of a curve, 1 cm apart, the curvature's slope jumps, and the torque with it.
class Detours : public ::testing::TestWithParam<int> {};

TEST_P(Detours, KeepTheirCurrentLimit) {
  std::mt19937_64 random(static_cast<std::uint64_t>(GetParam()));
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  test::Asked asked;
  asked.robot = test::amr();
  std::vector<Segment> segments;
  for (int k = 0; k <= GetParam() % 3; ++k) {
    const double length = between(4, 8);
    segments.push_back(GaussianDetour{length, between(-1, 1), length / 2, length / 9});
  }
  oracle::Question& q = asked.question;
  q.payload_kg = between(0, 40);
  asked.path = *make_path(segments, PathOptions{.start = {}, .payload_kg = q.payload_kg});
  asked.problem.limits = limits_of(asked.robot);
  q.current_a = asked.problem.limits.current_a = between(3, 6);
  q.robot = asked.robot;
  q.voltage_v = asked.problem.limits.voltage_v;
  if (GetParam() % 2) asked.problem.regeneration = 0;
  ASSERT_EQ(asked.path.runs.size(), 1);
  for (const Knot& knot : asked.path.runs[0].knots)
    q.way.at.push_back(knot.way), q.way.curvature_1_m.push_back(knot.curvature_1_m);
  const auto free = plan(asked.robot, asked.path, asked.problem);
  ASSERT_TRUE(free) << describe(free.error());
  EXPECT_LT(greatest_use(asked, free->profile), 1 + 2e-4);
  const double shortest = free->certificate.shortest_time_s;
  for (const double share : {0.0, 1e-4, 0.03, 0.5}) {
    asked.problem.deadline_s = shortest + share * (free->summary.duration_s - shortest);
    const auto hurried = plan(asked.robot, asked.path, asked.problem);
    ASSERT_TRUE(hurried) << describe(hurried.error());
    EXPECT_LT(greatest_use(asked, hurried->profile), 1 + 2e-4) << share;
  }
}

INSTANTIATE_TEST_SUITE_P(SixPaths, Detours, ::testing::Range(0, 6));
INSTANTIATE_TEST_SUITE_P(LongRest, Detours, ::testing::Range(6, 60));
INSTANTIATE_TEST_SUITE_P(EightProblems, AnySize, ::testing::Range(3000, 3008));
INSTANTIATE_TEST_SUITE_P(FasterThanMotorsKeep, AnySize, ::testing::Values(3054, 3346));
INSTANTIATE_TEST_SUITE_P(LongRest, AnySize, ::testing::Range(3008, 3060));
INSTANTIATE_TEST_SUITE_P(SixProblems, EffectsAgainstIpopt, ::testing::Range(1000, 1006));
INSTANTIATE_TEST_SUITE_P(LongRest, EffectsAgainstIpopt, ::testing::Range(1006, 1040));
INSTANTIATE_TEST_SUITE_P(ThreeGears, EffectsAgainstIpopt, ::testing::Range(2003, 2006));
INSTANTIATE_TEST_SUITE_P(LongGears, EffectsAgainstIpopt, ::testing::Range(2006, 2036));
INSTANTIATE_TEST_SUITE_P(FourteenProblems, AgainstIpopt, ::testing::Range(100, 114));
INSTANTIATE_TEST_SUITE_P(DeadlineWithinGridError, AgainstIpopt, ::testing::Values(117));
INSTANTIATE_TEST_SUITE_P(LongRest, AgainstIpopt, ::testing::Range(114, 150));

}  // namespace
}  // namespace joulecast::planning
