#include "gap/diagnose/held_out.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "gap/diagnose/naming.h"
#include "gap/equations/power.h"
#include "tests/gap/checks/made_recordings.h"

namespace joulecast::gap {
namespace {

struct Judged {
  HeldOut held;
  std::vector<double> shares;  // of the named, Shapley
};

// The parts of one robot's recordings, each judged without the others.
Judged judge_parts(const std::vector<made::vr::EffectStrength>& effects) {
  const made::Robot robot = made::virtual_robot("nomad", 31, [&](made::vr::SimulationSpec& spec) {
    spec.imperfections = *made::vr::make_imperfections(effects);
  });
  const auto readings = windows::find_readings(robot.recordings.missions);
  std::vector<Window> all = windows::make_windows(robot.recordings.missions, robot.model, readings);
  std::vector<double> lengths_s;
  for (const telemetry::Recording& m : robot.recordings.missions)
    lengths_s.push_back(1e-6 * static_cast<double>(m.samples.back().utime_us - m.samples.front().utime_us));
  const std::size_t blocks = windows::assign_blocks(all, lengths_s);
  const Material material{robot.model, {}, all, blocks, {}, readings.row_s};
  const std::vector<double> power_w = measured_power(all, robot.model, false);
  const FitSettings settings;
  const FitResult fit = *fit_windows(material, {}, settings, [] { return true; });
  Judged judged{*hold_out(material, fit, power_w, settings, [](double) { return true; }), {}};
  const Problem problem = make_problem(*fit.linear.columns, fit.linear.rows, fit.linear.noise, blocks);
  const HypothesisSet named = likely_causes(problem, explain(problem));
  judged.shares = held_out_shares(material, fit, problem, named, power_w);
  return judged;
}

TEST(HoldOut, WithoutAGapNoPartNamesAnything) {
  const auto [held, shares] = judge_parts({});
  ASSERT_EQ(held.named.size(), held.parts);
  EXPECT_GE(held.parts, 3u);
  for (const auto& names : held.named) EXPECT_TRUE(names.empty()) << names.front();
  EXPECT_EQ(held.explained(), held.unchanged());
  EXPECT_GT(held.unchanged(), 0);
  EXPECT_TRUE(shares.empty());
}

TEST(HoldOut, WhatIsThereIsNamedWithoutEachPartAndPredictsIt) {
  const auto [held, shares] = judge_parts({{"coulomb_friction", 0.6}});
  for (const auto& names : held.named) EXPECT_EQ(names, std::vector<std::string>{"coulomb_friction"});
  EXPECT_LT(held.explained(), 0.3 * held.unchanged());
  EXPECT_LT(held.explained(), held.referee());
  ASSERT_EQ(shares.size(), 1u);
  EXPECT_GT(shares[0], 0.7);
  EXPECT_LE(shares[0], 1);
}

TEST(HoldOut, CountsFitsThatNameOneOfAGroupAndWhatEnergiesDifferBy) {
  HeldOut held;
  held.parts = 4;
  held.named = {{"slope"}, {}, {"accessory_load", "slope"}, {"current_sensor_bias"}};
  const auto found = [&](const std::set<std::string>& ids) { return held.found_again(ids); };
  EXPECT_EQ(found({"slope"}), 0.5);
  EXPECT_EQ(found({"accessory_load", "current_sensor_bias"}), 0.5);
  EXPECT_EQ(found({"wheel_slip"}), 0);
  held.blocks = {{.size = 10, .unchanged_energy = 3, .explained_energy = -1},
                 {.size = 30, .unchanged_energy = -2, .explained_energy = 0}};
  EXPECT_EQ(held.unchanged_energy(), 5.0 / 40);
  EXPECT_EQ(held.explained_energy(), 1.0 / 40);
  EXPECT_EQ(held.moved_energy(), 6.0 / 40);
}

TEST(HoldOut, IsCancelledBetweenParts) {
  const made::Robot robot = made::virtual_robot("nomad", 32);
  const auto readings = windows::find_readings(robot.recordings.missions);
  std::vector<Window> all = windows::make_windows(robot.recordings.missions, robot.model, readings);
  const std::vector<double> lengths_s(robot.recordings.missions.size(), 40.0);
  const Material material{robot.model, {}, all, windows::assign_blocks(all, lengths_s), {}, readings.row_s};
  EXPECT_FALSE(fit_windows(material, {}, {}, [] { return false; }));
}

}  // namespace
}  // namespace joulecast::gap
