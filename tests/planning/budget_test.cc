// Fastest plans within an energy budget against direct transcriptions, which share nothing with the planner
// but the drive model, and against plans for a value of time.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "planning/planner.h"
#include "tests/planning/random_problem.h"
#include "tests/planning/transcription.h"

namespace joulecast::planning {
namespace {

Problem rowless(const robot::RobotModel& robot) {
  Problem problem;
  problem.limits = limits_of(robot);
  problem.rows = false;
  return problem;
}

// The energy of the fastest motion, as that of a price that nothing outweighs.
double hasty_energy_j(const Planner& planner, const Path& path, Problem problem) {
  problem.value_of_time_w = 1e6;
  return planner.cost(path, problem)->energy_j;
}

TEST(EnergyBudget, MatchesTheTranscription) {
  const robot::RobotModel robot = test::amr();
  for (const Segment& segment : {Segment{Straight{6}}, Segment{TurnInPlace{2.5}}, Segment{Arc{1.2, 2.0}}}) {
    const auto path = make_path(std::vector{segment}, PathOptions{.start = {}, .payload_kg = 15});
    for (const double regeneration : {1.0, 0.0}) {
      const auto planner = Planner::make(robot, regeneration);
      Problem problem = rowless(robot);
      const double least_j = planner->cost(*path, problem)->energy_j;
      problem.energy_budget_j = least_j + 0.3 * (hasty_energy_j(*planner, *path, problem) - least_j);
      const auto plan = planner->plan(*path, problem);
      ASSERT_TRUE(plan) << describe(plan.error());
      EXPECT_LE(plan->summary.energy_j, *problem.energy_budget_j);
      EXPECT_EQ(plan->certificate.binding.back(), Bound::energy_budget);
      // The least of energy and time at the plan's own price by the transcription: with the budget spent, no
      // motion within it is faster.
      const double price = plan->certificate.time_multiplier_w, energy_j = plan->summary.energy_j;
      const auto other = test::transcribed(robot, planner->loads().model(), path->runs.front(),
                                           problem.limits, 0, 0, price, 60);
      EXPECT_GT(energy_j, (1 - 1e-3) * *problem.energy_budget_j);
      EXPECT_NEAR(other.cost_j, energy_j + price * plan->summary.duration_s, 4e-3 * other.cost_j);
    }
  }
}

class EnergyBudgets : public ::testing::TestWithParam<int> {};

TEST_P(EnergyBudgets, AreSpentByTheFastestPlan) {
  for (int seed = 20 * GetParam(); seed < 20 * GetParam() + 20; ++seed) {
    test::RandomProblem p = test::random_problem(static_cast<std::uint64_t>(seed));
    const auto path = make_path(p.segments, p.options);
    const auto planner = Planner::make(p.robot, p.problem.regeneration);
    p.problem.value_of_time_w = 0;
    p.problem.deadline_s.reset();
    p.problem.rows = false;
    SCOPED_TRACE(seed);
    const auto free = planner->plan(*path, p.problem);
    if (!free) continue;
    const double least_j = free->summary.energy_j,
                 spare_j = hasty_energy_j(*planner, *path, p.problem) - least_j;
    if (!(spare_j > 1e-3 * least_j)) continue;
    Problem within = p.problem;
    within.energy_budget_j = least_j + (0.05 + 0.9 * std::fmod(0.618034 * seed, 1.0)) * spare_j;
    const auto plan = planner->plan(*path, within);
    ASSERT_TRUE(plan) << describe(plan.error());
    EXPECT_LE(plan->summary.energy_j, *within.energy_budget_j);
    // Plans for prices of time that end sooner take more than the budget.
    const double price = plan->certificate.time_multiplier_w;
    ASSERT_TRUE(std::isfinite(price));
    Problem priced = p.problem;
    for (const double factor : {0.3, 0.9, 1.0, 1.1, 3.0}) {
      priced.value_of_time_w = factor * price;
      const auto other = planner->cost(*path, priced);
      ASSERT_TRUE(other);
      if (other->energy_j > *within.energy_budget_j) continue;
      EXPECT_GT(other->duration_s, plan->summary.duration_s * (1 - 1e-3)) << factor;
    }
    // The certificate: no motion within the budget saves more time than its gap buys.
    EXPECT_LT(plan->certificate.gap_j, 0.02 * *within.energy_budget_j);
  }
}

INSTANTIATE_TEST_SUITE_P(OfEighty, EnergyBudgets, ::testing::Range(0, 4));

TEST(EnergyBudget, RefusesLessThanTheLeast) {
  const auto path = make_path(std::vector<Segment>{Straight{3}, TurnInPlace{1}}, PathOptions{.start = {}});
  const auto planner = Planner::make(test::amr());
  Problem problem = rowless(test::amr());
  const double least_j = planner->cost(*path, problem)->energy_j;
  problem.energy_budget_j = 0.9 * least_j;
  const auto refused = planner->plan(*path, problem);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::infeasible);
  EXPECT_EQ(refused.error().field, "energy_budget_j");
  // The named least is accepted.
  const std::string& text = refused.error().message;
  problem.energy_budget_j = std::stod(text.substr(text.find("less than ") + 10));
  EXPECT_NEAR(*problem.energy_budget_j, least_j, 3e-5 * least_j);
  EXPECT_TRUE(planner->plan(*path, problem));
}

// As a client does that reads the least energy with ten digits.
TEST(EnergyBudget, LeastEnergyIsEnough) {
  const std::vector<std::vector<Segment>> paths{
      {Straight{7}}, {Straight{3}, Arc{1, 1.2}, Straight{3}}, {Straight{2}, TurnInPlace{1}, Straight{5}}};
  for (const auto& segments : paths) {
    const auto path = make_path(segments, PathOptions{.start = {}});
    Problem problem = rowless(test::amr());
    const auto least = plan(test::amr(), *path, problem);
    ASSERT_TRUE(least);
    const double least_j = std::stod(fmt::format("{:.10g}", least->summary.energy_j));
    for (const double excess : {0.0, 1e-6, 2e-5, 3e-5}) {
      problem.energy_budget_j = (1 + excess) * least_j;
      const auto within = plan(test::amr(), *path, problem);
      ASSERT_TRUE(within) << excess << ' ' << describe(within.error());
      EXPECT_LE(within->summary.energy_j, (1 + 1e-9) * *problem.energy_budget_j);
      EXPECT_LE(within->summary.duration_s, (1 + 1e-6) * least->summary.duration_s);
    }
    problem.energy_budget_j = (1 - 1e-6) * least_j;
    EXPECT_FALSE(plan(test::amr(), *path, problem));
  }
}

TEST(EnergyBudget, AmpleBudgetGivesTheFastest) {
  const auto path = make_path(std::vector<Segment>{Straight{3}, Arc{1, 1.5}}, PathOptions{.start = {}});
  const auto planner = Planner::make(test::amr());
  Problem problem = rowless(test::amr());
  problem.energy_budget_j = 1e6;
  const auto plan = planner->plan(*path, problem);
  ASSERT_TRUE(plan);
  EXPECT_NEAR(plan->summary.duration_s, plan->certificate.shortest_time_s, 1e-6 * plan->summary.duration_s);
}

TEST(EnergyBudget, ExcludesOtherWeights) {
  const auto path = make_path(std::vector<Segment>{Straight{3}}, PathOptions{.start = {}});
  Problem problem = rowless(test::amr());
  problem.energy_budget_j = 1e6;
  problem.deadline_s = 10;
  EXPECT_FALSE(plan(test::amr(), *path, problem));
  problem.deadline_s.reset();
  problem.value_of_time_w = 1;
  EXPECT_FALSE(plan(test::amr(), *path, problem));
}

}  // namespace
}  // namespace joulecast::planning
