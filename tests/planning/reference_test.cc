// The planner against iterative dynamic programming on random problems: four robots, all shapes of path, all
// regeneration fractions, limits binding and not, adopted effects.
#include "tests/planning/reference.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "planning/planner.h"
#include "tests/planning/random_problem.h"

namespace joulecast::planning {
namespace {

class AgainstReference : public ::testing::TestWithParam<int> {};

TEST_P(AgainstReference, CostsTheSameWithinLimits) {
  for (int i = 0; i < 10; ++i) {
    const int seed = 10 * GetParam() + i;
    const test::RandomProblem p = test::random_problem(static_cast<std::uint64_t>(seed));
    SCOPED_TRACE(std::to_string(seed) + " " + p.robot.robot_id + " " + p.label);
    const auto path = make_path(p.segments, p.options);
    ASSERT_TRUE(path) << describe(path.error());
    // Some curves begin with a turn in place: compare their driven part.
    Path run;
    run.runs = {path->runs.back()};
    const auto answer = plan(p.robot, run, p.problem);
    ASSERT_TRUE(answer) << describe(answer.error());
    const auto loads = DriveLoads::make(p.robot, p.problem.regeneration);
    ASSERT_TRUE(loads);
    const double cost = answer->summary.energy_j + p.problem.value_of_time_w * answer->summary.duration_s;
    // A finer table where the coarse one is not accurate enough.
    test::ReferenceAnswer best;
    best.cost_j = std::numeric_limits<double>::infinity();
    for (int stations : {48, 80, 128}) {
      const auto found =
          test::reference(p.robot, loads->model(), run.runs[0], p.problem.limits, p.problem.start_speed_m_s,
                          p.problem.end_speed_m_s, p.problem.value_of_time_w, stations);
      if (found.excess < 1e-3 && found.cost_j < best.cost_j) best = found;
      if (std::fabs(cost - best.cost_j) < 8e-4 * std::fabs(best.cost_j)) break;
    }
    EXPECT_NEAR(cost, best.cost_j, 1e-3 * std::fabs(best.cost_j));

    const Certificate& c = answer->certificate;
    // A brush drop adds a second kink to the regeneration's, where the dual slope bounds less tightly.
    const bool brush = p.label.find("brush_drop") != std::string::npos;
    EXPECT_LT(c.gap_j, (brush ? 5e-3 : 1e-4) * std::fabs(cost));
    EXPECT_LT(c.residual, 1e-2);
    // Where the energy goes adds up.
    EXPECT_NEAR(answer->ledger.total(), answer->summary.energy_j, 1e-9 * std::fabs(cost));

    // The profile is driveable: limits hold on its rows and its columns are derivatives of each other.
    const Profile& rows = answer->profile;
    const Limits& l = p.problem.limits;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      EXPECT_LE(rows.speed_m_s[k], l.speed_m_s * (1 + 1e-9));
      EXPECT_LE(std::fabs(rows.yaw_rate_rad_s[k]), l.yaw_rate_rad_s * (1 + 1e-6));
      EXPECT_LE(std::fabs(rows.acceleration_m_s2[k]), l.acceleration_m_s2 * (1 + 1e-9));
      const double payload = rows.payload_kg[k];
      const auto& q = loads->model().parameters();
      dynamics::Instant at;
      at.wheel_speed_rad_s = dynamics::wheels_of_body(q, rows.speed_m_s[k], rows.yaw_rate_rad_s[k]);
      at.wheel_acceleration_rad_s2 =
          dynamics::wheels_of_body(q, rows.acceleration_m_s2[k], rows.yaw_acceleration_rad_s2[k]);
      at.payload_kg = payload, at.x_m = rows.x_m[k], at.y_m = rows.y_m[k],
      at.heading_rad = rows.heading_rad[k];
      const auto flow = loads->model().flow(at);
      EXPECT_NEAR(flow.battery_power_w, rows.power_w[k], 1e-6 * std::fabs(rows.power_w[k]) + 1e-6);
      // Dry friction fades below 0.005 rad/s, where a standing wheel brakes with its motor alone.
      if (rows.speed_m_s[k] + std::fabs(rows.yaw_rate_rad_s[k]) < 0.01) continue;
      for (std::size_t s : {0u, 1u}) {
        EXPECT_LE(std::fabs(flow.current_a[s]), l.current_a * 1.003);
        EXPECT_LE(std::fabs(flow.voltage_v[s]), l.voltage_v * 1.003);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(EightyProblems, AgainstReference, ::testing::Range(0, 8));
INSTANTIATE_TEST_SUITE_P(LongRest, AgainstReference, ::testing::Range(8, 22));

}  // namespace
}  // namespace joulecast::planning
