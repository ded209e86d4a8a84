#include "gap/runs/run_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "made_runs.h"
#include "tests/support/straight_power.h"

namespace joulecast::gap {
namespace {

using testing::nomad;

// The quadrature compared with the closed form of a straight run: dE of both motors by (4-1).
TEST(RunEnergy, MatchesClosedForm) {
  const robot::RobotModel robot = nomad();
  const auto model = dynamics::drive_model(robot).value();
  const auto power = dynamics::straight_power(robot, 5).over_distance();
  const double a = 0.2, v = 0.8, distance = 10, rise = v / a, cruise = distance / v - rise;
  // Speed v(t) = a t and back: terms odd in the acceleration cancel between starting and braking.
  const double expected = 2 * rise * (power.c1 * a * a + power.c2 * v * v / 3 + power.c3 * v / 2 + power.c0) +
                          cruise * power.power_w(v, 0);
  const RunEnergy energy = run_energy(model, {distance, v, a, 5, 0, 0, 0});
  // Friction fades below 0.005 rad/s, which the closed form omits: 0.005 rad/s of 8.
  EXPECT_NEAR(energy.motor_j[0] + energy.motor_j[1], expected, 1e-3 * expected);
  EXPECT_NEAR(energy.duration_s, 2 * rise + cruise, 1e-9);
  EXPECT_NEAR(energy.battery_j,
              energy.motor_j[0] + energy.motor_j[1] + robot.idle_power_w * energy.duration_s,
              1e-6 * expected);
}

TEST(RunEnergy, MovesEnergyToOuterWheel) {
  const auto model = dynamics::drive_model(nomad()).value();
  const RunEnergy straight = run_energy(model, {4, 0.5, 0.3, 0, 0, 0, 0});
  const RunEnergy left = run_energy(model, {4, 0.5, 0.3, 0, std::numbers::pi / 2, 1.5, 0});
  const RunEnergy right = run_energy(model, {4, 0.5, 0.3, 0, -std::numbers::pi / 2, 1.5, 0});
  EXPECT_GT(left.motor_j[0], straight.motor_j[0]);
  EXPECT_LT(left.motor_j[1], straight.motor_j[1]);
  EXPECT_GT(right.motor_j[1], straight.motor_j[1]);
  EXPECT_LT(right.motor_j[0], straight.motor_j[0]);
}

std::string error_of(const std::string& csv) {
  const RunFile file{"runs.csv", csv};
  const auto runs = read_runs({&file, 1}, nomad());
  return runs ? "" : describe(runs.error());
}

TEST(RunTable, NamesRowAndColumn) {
  EXPECT_EQ(error_of("distance_m,energy_j\n10,100\n"), "runs.csv: line 1: column speed_m_s is required");
  EXPECT_EQ(error_of("distance_m,speed_m_s,joules\n10,1,100\n"),
            "runs.csv: line 1: column joules is none of a table of runs; covariate:joules or label:joules "
            "would make it a "
            "possible cause");
  EXPECT_EQ(error_of("distance_m,speed_m_s,energy_j\n10,1,100\n10,fast,100\n"),
            "runs.csv: line 3: column speed_m_s: 'fast' must be at least 0.001 m/s and at most 100 m/s");
  EXPECT_EQ(error_of("distance_m,speed_m_s,energy_j\n10,1,\n"),
            "runs.csv: line 2: column energy_j: '' is required unless right_j and left_j are given");
  EXPECT_EQ(error_of("distance_m,speed_m_s,right_j\n10,1,5\n"),
            "runs.csv: line 2: column left_j: '' is required with the other motor's");
  EXPECT_EQ(error_of("distance_m,speed_m_s,turn_radius_m,turn_deg,turn_side,energy_j\n10,1,4,270,left,5\n"),
            "runs.csv: line 2: column turn_deg: '270' is an arc longer than distance_m");
  EXPECT_EQ(error_of("distance_m,speed_m_s,turn_radius_m,turn_side,energy_j\n10,1,4,up,5\n"),
            "runs.csv: line 2: column turn_side: 'up' must be left or right");
  EXPECT_EQ(error_of("distance_m,speed_m_s,energy_j,covariate:cpu\n10,1,100,much\n"),
            "runs.csv: line 2: column cpu: 'much' must be a number");
  EXPECT_EQ(error_of("distance_m,speed_m_s,energy_j,climb_m\n10,1,100,11\n"),
            "runs.csv: line 2: column climb_m: '11' is more than distance_m");
  EXPECT_EQ(error_of("distance_m,speed_m_s,energy_j\n10,1,100\n"),
            "runs.csv: holds 1 runs, at least 3 are needed");
}

TEST(RunTable, MergesTablesOfRuns) {
  const std::vector<RunFile> files{
      {"day1.csv",
       "distance_m,speed_m_s,energy_j,covariate:cpu,label:surface\n10,1,100,0.5,hard\n10,1,110,,carpet\n"},
      {"day2.csv", "distance_m,speed_m_s,energy_j,label:driver,climb_m\n20,0.5,300,ann,1.5\n"}};
  const auto set = read_runs(files, nomad());
  ASSERT_TRUE(set) << describe(set.error());
  ASSERT_EQ(set->runs.size(), 3u);
  EXPECT_EQ(set->covariates, std::vector<std::string>{"cpu"});
  EXPECT_EQ(set->labels, (std::vector<std::string>{"surface", "driver"}));
  EXPECT_EQ(set->runs[0].table, "day1.csv");
  EXPECT_EQ(set->runs[0].covariates[0], 0.5);
  EXPECT_TRUE(std::isnan(set->runs[1].covariates[0]));
  EXPECT_TRUE(std::isnan(set->runs[2].covariates[0]));
  EXPECT_EQ(set->runs[1].labels[0], "carpet");
  EXPECT_EQ(set->runs[2].labels[1], "ann");
  EXPECT_EQ(set->runs[2].at.climb_m, 1.5);
  EXPECT_EQ(set->groups_by("table")->back(), "day2.csv");
  EXPECT_FALSE(set->groups_by("surface"));
}

}  // namespace
}  // namespace joulecast::gap
