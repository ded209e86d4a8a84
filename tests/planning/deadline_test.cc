// Plans for a deadline against plans for a value of time that end as late, and against IPOPT.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "planning/planner.h"
#include "tests/planning/robots.h"

namespace joulecast::planning {
namespace {

struct Hurried {
  robot::RobotModel robot;
  Path path;
  Problem problem;
  std::string label;
};

// Two to four joined segments, current and voltage limits, an effect on every second one.
Hurried hurried_problem(std::uint64_t seed) {
  std::mt19937_64 random(seed * 2862933555777941757u + 3037000493u);
  random.discard(8);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  const auto one_of = [&](std::uint64_t n) { return random() % n; };
  Hurried p;
  p.robot = test::all_robots()[one_of(4)];
  if (one_of(3) == 0) p.robot.kinematics.com_offset_m = between(0, 0.08);
  const double payload = between(0, p.robot.limits.payload_kg);
  std::vector<Segment> segments;
  const std::uint64_t count = 1 + one_of(4);
  Pose at;
  for (std::uint64_t k = 0; k < count; ++k) {
    switch (one_of(6)) {
      case 0:
      case 1:
        segments.push_back(Straight{std::exp(between(std::log(0.4), std::log(5)))});
        p.label += " straight";
        break;
      case 2:
        segments.push_back(TurnInPlace{(one_of(2) ? 1 : -1) * between(0.3, 2.5)});
        p.label += " turn";
        break;
      case 3:
        segments.push_back(Arc{between(0.4, 3), (one_of(2) ? 1 : -1) * between(0.4, 2)});
        p.label += " arc";
        break;
      case 4:
        segments.push_back(Clothoid{between(1, 4), between(-0.8, 0.8), between(-0.8, 0.8)});
        p.label += " clothoid";
        break;
      default:
        segments.push_back(GaussianDetour{between(4, 7), between(-0.8, 0.8), between(2, 3), between(0.5, 1)});
        p.label += " detour";
    }
  }
  p.path = *make_path(segments, PathOptions{.start = at, .payload_kg = payload, .resolution_m = 0.04});
  p.problem.rows = false;
  p.problem.limits = limits_of(p.robot);
  const double fractions[] = {1, 0, 0, between(0, 1)};
  p.problem.regeneration = fractions[one_of(4)];
  const auto& m = p.robot.motor;
  const double kn = m.torque_constant_nm_a * m.gear_ratio;
  const double friction = std::max(m.friction_torque_nm[0], m.friction_torque_nm[1]) / kn;
  const double push = p.robot.total_mass_kg(payload) * p.robot.kinematics.wheel_radius_m / 2 / kn;
  if (one_of(2)) {
    p.problem.limits.current_a =
        1.6 * friction + push * between(0.05, 0.4) + m.viscous_friction_nm_s_rad * 4 / kn;
    p.label += " current";
  }
  if (one_of(3) == 0) p.problem.limits.voltage_v *= between(0.4, 0.8), p.label += " voltage";
  if (one_of(2)) {
    const std::vector<robot::AdoptedEffect> effects = {
        {"turning_scrub", {{"coefficient", between(0.05, 0.2)}}},
        {"aerodynamic_drag", {{"coefficient_n_s2_m2", between(0.5, 5)}}},
        {"gear_efficiency", {{"loss", between(0.02, 0.4)}, {"of_friction", between(0, 1)}}},
        {"stribeck_friction",
         {{"ratio", between(0.2, 0.5)}, {"speed_rad_s", between(0.5, 3)}, {"exponent", 2}}},
        {"driver_loss", {{"fraction", between(0.02, 0.1)}}},
        {"brush_drop", {{"voltage_v", between(0.2, 0.6)}}},
        {"slope", {{"angle_rad", between(0.003, 0.02)}, {"uphill_rad", between(-3, 3)}}},
        {"load_rolling_resistance", {{"coefficient", between(0.005, 0.03)}}}};
    p.robot.effects.push_back(effects[one_of(effects.size())]);
    p.label += " " + p.robot.effects.back().id;
  }
  p.label = p.robot.robot_id + p.label + " regeneration " + std::to_string(*p.problem.regeneration);
  return p;
}

// Of plans for a value of time, the cheapest that ends by the deadline, found by halving; plans that end
// later give a lower bound on the cost of any plan.
struct ByPrice {
  double energy_j = std::numeric_limits<double>::infinity();
  double least_j = 0;
};
ByPrice by_price(const Planner& planner, const Hurried& p, double deadline_s, double free_w) {
  Problem problem = p.problem;
  problem.hurried = true;
  ByPrice found;
  double low = 0, high = 0;
  for (int k = 0; k < 30; ++k) {
    const double price = high == 0 ? std::ldexp(free_w, k) : low == 0 ? 0.5 * high : std::sqrt(low * high);
    problem.value_of_time_w = price;
    const auto cost = planner.cost(p.path, problem);
    if (!cost) break;
    if (cost->duration_s <= deadline_s) found.energy_j = std::min(found.energy_j, cost->energy_j);
    found.least_j = std::max(found.least_j, cost->energy_j + price * (cost->duration_s - deadline_s));
    if (found.energy_j - found.least_j < 1e-4 * found.energy_j) break;
    (cost->duration_s <= deadline_s ? high : low) = price;
    if (high > 0 && low > 0 && high / low < 1 + 1e-5) break;
  }
  return found;
}

// Just before and after where one more solve at the same price may end on the other side of the deadline.
TEST(Deadline, NeverReturnsTheFastestMotion) {
  const auto path =
      make_path(std::vector<Segment>{Straight{2}, Arc{0.8, 1.57}, Straight{2}}, PathOptions{.start = {}});
  const auto planner = Planner::make(test::amr(), 0.0);
  Problem problem;
  problem.limits = limits_of(test::amr());
  problem.rows = false;
  const auto free = planner->plan(*path, problem);
  const double shortest = free->certificate.shortest_time_s, spare = free->summary.duration_s - shortest;
  double before = 1e300;
  for (int k = 1; k < 60; ++k) {
    problem.deadline_s = shortest + spare * k / 60;
    const auto plan = planner->plan(*path, problem);
    ASSERT_TRUE(plan);
    EXPECT_LT(plan->summary.energy_j, before * (1 + 3e-4)) << *problem.deadline_s;
    before = plan->summary.energy_j;
  }
  EXPECT_LT(before, free->summary.energy_j * (1 + 1e-3));
}

// The search for a price takes a bounded number of solves, on paths of any length.
TEST(Deadline, WorkIsBoundedOnLongPaths) {
  const auto planner = Planner::make(test::amr(), 0.0);
  ASSERT_TRUE(planner);
  for (const int kind : {0, 1, 2}) {
    for (const int count : {3, 10}) {
      std::vector<Segment> segments;
      for (int k = 0; k < count; ++k) {
        const double side = k % 2 ? -1 : 1;
        if (kind == 0) segments.push_back(Arc{1.0 + 0.1 * (k % 5), 0.9 * side});
        if (kind == 1) segments.push_back(Clothoid{2.0 + 0.1 * (k % 5), -0.5 * side, 0.5 * side});
        if (kind == 2)
          segments.push_back(k % 2 ? Segment{TurnInPlace{1.2}} : Segment{GaussianDetour{6, 0.6, 3, 0.7}});
      }
      const auto path = make_path(segments, PathOptions{.start = {}, .payload_kg = 20});
      Problem problem;
      problem.limits = limits_of(test::amr());
      problem.limits.current_a = 3.5;
      problem.rows = false;
      const auto free = planner->plan(*path, problem);
      ASSERT_TRUE(free) << describe(free.error());
      ASSERT_GT(free->certificate.iterations, 0);
      problem.deadline_s = 0.5 * (free->certificate.shortest_time_s + free->summary.duration_s);
      const auto hurried = planner->plan(*path, problem);
      ASSERT_TRUE(hurried) << describe(hurried.error());
      EXPECT_LT(hurried->certificate.iterations, 12 * free->certificate.iterations)
          << kind << " of " << count;
    }
  }
}

class Deadlines : public ::testing::TestWithParam<int> {};

TEST_P(Deadlines, CostIsTheLeast) {
  for (int seed = 10 * GetParam(); seed < 10 * GetParam() + 10; ++seed) {
    const Hurried p = hurried_problem(static_cast<std::uint64_t>(seed));
    SCOPED_TRACE(std::to_string(seed) + " " + p.label);
    const auto planner = Planner::make(p.robot, p.problem.regeneration);
    ASSERT_TRUE(planner);
    const auto free = planner->plan(p.path, p.problem);
    if (!free) {
      EXPECT_EQ(free.error().fault, Fault::infeasible) << describe(free.error());
      continue;
    }
    const double shortest = free->certificate.shortest_time_s;
    if (!(free->summary.duration_s > shortest * (1 + 1e-4))) continue;
    const double share = 0.02 + 0.96 * std::fmod(0.618034 * seed, 1.0);
    Problem hurried = p.problem;
    hurried.deadline_s = shortest + share * (free->summary.duration_s - shortest);
    const auto plan = planner->plan(p.path, hurried);
    ASSERT_TRUE(plan) << describe(plan.error());
    EXPECT_LE(plan->summary.duration_s, *hurried.deadline_s * (1 + 1e-9));
    const double energy = plan->summary.energy_j;
    const ByPrice best =
        by_price(*planner, p, *hurried.deadline_s, free->summary.energy_j / free->summary.duration_s);
    EXPECT_LT(energy, best.energy_j * (1 + 1e-3)) << "at a share of " << share;
    const Certificate& c = plan->certificate;
    EXPECT_LT(energy - c.gap_j - c.discretisation_j, best.energy_j);
  }
}

INSTANTIATE_TEST_SUITE_P(OfAHundred, Deadlines, ::testing::Range(0, 10));
INSTANTIATE_TEST_SUITE_P(LongTwoThousand, Deadlines, ::testing::Range(10, 200));

}  // namespace
}  // namespace joulecast::planning
