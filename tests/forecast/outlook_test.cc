#include "forecast/outlook.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "battery/circuit.h"
#include "client/virtual_robot/rng.h"
#include "robots.h"

namespace joulecast::forecast {
namespace {

using virtual_robot::Rng;

constexpr double standing_w = 20;

// A robot with an exact model but for the scatter of its missions and legs.
Forecaster forecaster(double common, double leg) {
  Forecaster f;
  for (Forecaster::Track& track : f.tracks) {
    track.common = common;
    track.scatter = {leg, leg, leg};
  }
  f.payload_limit_kg = 10;
  return f;
}

PricedLeg drive(double energy_j, double way_m = 10) {
  return {Motion::drive, 0, way_m, {energy_j / 100, 0.2 * energy_j, 0.8 * energy_j, 0.6}};
}

ChargeMap battery() {
  return ChargeMap{battery::Circuit(shipped("amr").battery)};
}

TEST(Prediction, OnlyOwnScatterAveragesOut) {
  const Forecaster f = forecaster(0.03, 0.2);
  for (const int count : {1, 4, 25, 100}) {
    PlanSum sum;
    for (int k = 0; k < count; ++k) f.extend(sum, drive(500));
    const Prediction p = f.energy(sum);
    EXPECT_NEAR(p.legs, 500 * count, 1e-9 * p.legs);
    EXPECT_NEAR(p.spread, std::sqrt(0.03 * 0.03 + 0.2 * 0.2 / count), 1e-12);
  }
}

// Fewer missions of a robot widen the intervals of its energy; the expected one is the model's.
TEST(Prediction, UncertaintyKeepsTheMean) {
  double width = 0;
  for (const double deviation : {0.0, 0.1, 0.3, 0.5}) {
    Forecaster f = forecaster(0.01, 0.02);
    for (Forecaster::Track& track : f.tracks)
      for (std::size_t k = 0; k < feature_count; ++k)
        track.correction.covariance[k][k] = deviation * deviation;
    PlanSum sum;
    for (int k = 0; k < 4; ++k) f.extend(sum, drive(500));
    const Prediction p = f.energy(sum);
    EXPECT_NEAR(p.expected(), 2000, 1e-9);
    EXPECT_GT(p.quantile(0.95) - p.quantile(0.05), width);
    width = p.quantile(0.95) - p.quantile(0.05);
  }
}

// Missions drawn from the predictive distribution: the probability of staying within a budget is the share of
// those that do. Where the budget is uncertain too, its part is taken into the width, which is exact for
// normals.
TEST(Prediction, ProbabilityIsShareOfDraws) {
  const Forecaster f = forecaster(0.05, 0.1);
  PlanSum sum;
  for (int k = 0; k < 6; ++k) f.extend(sum, drive(800));
  const Prediction p = f.energy(sum);
  Rng rng(9);
  // Budgets as exact as the plan's energy, and uncertain ones many times as large, as with a very uncertain
  // charge.
  struct Case {
    double factor, deviation_j;
  };
  std::vector<Case> cases;
  for (const double deviation_j : {0.0, 150.0, 600.0}) {
    for (const double factor : {0.93, 0.98, 1.0, 1.04, 1.1}) cases.push_back({factor, deviation_j});
  }
  for (const double factor : {0.0, 5.0, 100.0, 1000.0}) {
    for (const double share : {0.2, 0.4, 0.6, 1.5})
      cases.push_back({factor, share * std::max(1.0, factor) * p.legs});
  }
  for (const auto& [factor, deviation_j] : cases) {
    const double budget = factor * p.legs;
    int within = 0;
    constexpr int draws = 20'000;
    for (int k = 0; k < draws; ++k) {
      const double energy = p.legs * std::exp(p.spread * p.scores->quantile(rng.uniform()));
      within += energy <= budget + deviation_j * rng.normal();
    }
    const double shape = deviation_j > 0 ? 0.02 : 0.5 / static_cast<double>(ScoreDistribution::count);
    EXPECT_NEAR(p.probability_below(budget, deviation_j), static_cast<double>(within) / draws,
                4 * std::sqrt(0.25 / draws) + shape)
        << factor << " +- " << deviation_j;
  }
}

TEST(Outlook, ReportsLegsAndFailure) {
  const Forecaster f = forecaster(0.03, 0.05);
  const ChargeMap map = battery();
  const double usable = map.energy_j(0.5, 0.15, 100);
  std::vector<PricedTask> tasks(5);
  for (PricedTask& task : tasks) task.legs = {drive(0.3 * usable, 100)};
  const Outlook out = look_ahead(f, map, {0.5, 0, 0.15}, tasks, {}, standing_w, 0.95);
  ASSERT_EQ(out.tasks.size(), 5u);
  ASSERT_TRUE(out.fails_at);
  EXPECT_EQ(*out.fails_at, 3u);  // 0.9 of the usable energy after three, 1.2 after four
  EXPECT_EQ(*out.likeliest_failure, 3u);
  EXPECT_GT(out.tasks[2].probability, 0.9);
  EXPECT_LT(out.tasks[3].probability, 0.01);
  EXPECT_FALSE(out.charger);
  EXPECT_FALSE(out.latest_departure);
  for (std::size_t k = 1; k < 5; ++k) {
    EXPECT_LE(out.tasks[k].probability, out.tasks[k - 1].probability);
    for (std::size_t q = 0; q < 3; ++q) EXPECT_LE(out.tasks[k].charge[q], out.tasks[k - 1].charge[q]);
  }
  for (const TaskOutlook& task : out.tasks) {
    EXPECT_LE(task.charge[0], task.charge[1]);
    EXPECT_LE(task.charge[1], task.charge[2]);
    EXPECT_LE(task.energy_j[0], task.energy_j[1]);
  }
  EXPECT_NEAR(out.mean_j, 1.5 * usable, 1e-9 * usable);
  EXPECT_EQ(out.probability, out.tasks.back().probability);
}

TEST(Outlook, LegMeansIgnoreLaterLegs) {
  const Forecaster f = forecaster(0.03, 0.05);
  const std::vector<PricedTask> tasks(5, {{drive(500, 100)}, {}});
  for (std::size_t count = 1; count <= tasks.size(); ++count) {
    const Outlook out =
        look_ahead(f, battery(), {0.5, 0, 0.15}, std::span(tasks).first(count), {}, standing_w, 0.95);
    for (const TaskOutlook& task : out.tasks) EXPECT_NEAR(task.mean_j, 500, 1e-9);
  }
}

TEST(Outlook, LatestDepartureKeepsTheConfidence) {
  const Forecaster f = forecaster(0.03, 0.05);
  const ChargeMap map = battery();
  const double usable = map.energy_j(0.5, 0.15, 100);
  std::vector<PricedTask> tasks(5);
  for (PricedTask& task : tasks) {
    task.legs = {drive(0.2 * usable, 100)};
    task.to_charger = {drive(0.1 * usable, 50)};
  }
  const std::vector<PricedLeg> from_here{drive(0.1 * usable, 50)};
  const Outlook out = look_ahead(f, map, {0.5, 0, 0.15}, tasks, from_here, standing_w, 0.95);
  ASSERT_TRUE(out.latest_departure);
  EXPECT_EQ(out.latest_departure->after_tasks, 4u);  // 0.8 + 0.1 fits, 1.0 + 0.1 does not
  EXPECT_GE(out.latest_departure->probability, 0.95);
  EXPECT_NEAR(out.latest_departure->at_s, out.tasks[3].duration_s, 1e-9);
  EXPECT_GT(out.latest_departure->wait_s, 0);
  ASSERT_TRUE(out.charger);
  EXPECT_LT(out.probability, 0.05);

  // After the longest wait the confidence is just reached.
  tasks.resize(4);
  tasks.back().legs.push_back(
      {Motion::stand, 0, 0, {out.latest_departure->wait_s, standing_w * out.latest_departure->wait_s, 0, 0}});
  const Outlook waited = look_ahead(f, map, {0.5, 0, 0.15}, tasks, from_here, standing_w, 0.95);
  EXPECT_NEAR(waited.probability, 0.95, 0.01);
}

// Missions drawn from the scatter that the robot has, its scores with the t distribution of 5 degrees of
// freedom of a robot without missions, return from the latest departure as often as asked.
TEST(Outlook, LatestDeparturesReturnAsOften) {
  constexpr double common = 0.06;
  const Forecaster f = forecaster(common, 0);
  const ChargeMap map = battery();
  const double leg_j = 0.09 * map.energy_j(0.5, 0.15, 100), back_j = 0.5 * leg_j;
  std::vector<PricedTask> tasks(14);
  for (PricedTask& task : tasks) task.legs = {drive(leg_j)}, task.to_charger = {drive(back_j)};
  for (const double confidence : {0.5, 0.8, 0.95}) {
    const Outlook out =
        look_ahead(f, map, {0.5, 0, 0.15}, tasks, std::vector{drive(back_j)}, standing_w, confidence);
    ASSERT_TRUE(out.latest_departure);
    const double driven_j = static_cast<double>(out.latest_departure->after_tasks) * leg_j + back_j,
                 waited_j = standing_w * out.latest_departure->wait_s;
    const double mean_w = (driven_j + waited_j) / (driven_j / 100 + out.latest_departure->wait_s);
    const double usable_j = map.energy_j(0.5, 0.15, mean_w);
    std::mt19937_64 random(36);
    std::student_t_distribution<> score(5);
    constexpr int draws = 20'000;
    int returned = 0;
    for (int k = 0; k < draws; ++k)
      returned += driven_j * std::exp(common * std::sqrt(0.6) * score(random)) + waited_j <= usable_j;
    EXPECT_NEAR(static_cast<double>(returned) / draws, confidence, 0.02);
  }
}

TEST(Outlook, TooLateHasNoDeparture) {
  const Forecaster f = forecaster(0.03, 0.05);
  const ChargeMap map = battery();
  const std::vector<PricedLeg> from_here{drive(map.energy_j(0.2, 0.1, 100), 50)};
  const Outlook out = look_ahead(f, map, {0.2, 0, 0.15}, {}, from_here, standing_w, 0.95);
  EXPECT_FALSE(out.latest_departure);
  EXPECT_LT(out.probability, 0.01);
  ASSERT_TRUE(out.fails_at);
  EXPECT_EQ(*out.fails_at, 0u);  // the way to the charger
}

TEST(Outlook, UncertainChargeWidensArrival) {
  const Forecaster f = forecaster(0.03, 0.05);
  const ChargeMap map = battery();
  std::vector<PricedTask> tasks(1);
  tasks[0].legs = {drive(0.9 * map.energy_j(0.5, 0.15, 100), 100)};
  const Outlook sure = look_ahead(f, map, {0.5, 0, 0.15}, tasks, {}, standing_w, 0.95);
  const Outlook vague = look_ahead(f, map, {0.5, 0.05, 0.15}, tasks, {}, standing_w, 0.95);
  EXPECT_LT(vague.probability, sure.probability);
  EXPECT_LT(vague.tasks[0].charge[0], sure.tasks[0].charge[0]);
  EXPECT_GT(vague.tasks[0].charge[2], sure.tasks[0].charge[2]);
  EXPECT_NEAR(vague.tasks[0].charge[1], sure.tasks[0].charge[1], 1e-12);
}

TEST(Outlook, TypicalCurveWidensTheOutlook) {
  const Forecaster f = forecaster(0.005, 0.005);
  robot::Battery own = shipped("amr").battery;
  ASSERT_TRUE(own.open_circuit_voltage.empty());
  const ChargeMap typical = battery();
  own.open_circuit_voltage = battery::default_open_circuit_voltage(own.nominal_voltage_v);
  const ChargeMap known{battery::Circuit(own)};
  std::vector<PricedTask> tasks(1);
  tasks[0].legs = {drive(0.985 * known.energy_j(0.8, 0.15, 100), 100)};
  const Outlook sure = look_ahead(f, known, {0.8, 0, 0.15}, tasks, {}, standing_w, 0.95);
  const Outlook vague = look_ahead(f, typical, {0.8, 0, 0.15}, tasks, {}, standing_w, 0.95);
  EXPECT_LT(vague.probability, sure.probability);
  EXPECT_EQ(vague.tasks[0].charge[1], sure.tasks[0].charge[1]);
  // The voltage's own part, at least.
  EXPECT_LT(vague.tasks[0].charge[0], vague.tasks[0].charge[1] - 1.64 * 0.008 * 0.64);
  EXPECT_LT(sure.tasks[0].charge[0], sure.tasks[0].charge[1] - 1.64 * 0.004 * 0.64);
  EXPECT_GT(sure.tasks[0].charge[0], vague.tasks[0].charge[0]);
}

TEST(Reach, RangeFollowsTheCharge) {
  const Forecaster f = forecaster(0.04, 0.2);
  const ChargeMap map = battery();
  const std::vector<PricedLeg> typical{drive(500, 10), {Motion::stand, 0, 0, {5, 100, 0, 0}}};
  const Reach r = reach(f, map, {0.6, 0, 0.15}, {sum_of(f, typical)});
  EXPECT_NEAR(r.energy_per_m_j, 60, 1e-9);
  EXPECT_NEAR(r.mean_power_w, 60, 1e-9);
  EXPECT_NEAR(r.usable_j, map.energy_j(0.6, 0.15, 60), 1e-6);
  EXPECT_NEAR(r.range_m[1], r.usable_j / 60, 1e-6 * r.range_m[1]);
  EXPECT_NEAR(r.run_time_s[1], r.usable_j / 60, 1e-6 * r.run_time_s[1]);
  EXPECT_LT(r.range_m[0], r.range_m[1]);
  EXPECT_LT(r.range_m[1], r.range_m[2]);
  // Hundreds of legs: their own scatter is gone, the common 4 % stays.
  const double quantile = f.tracks[0].scores.quantile(0.95);
  EXPECT_NEAR(r.range_m[0] / r.range_m[1], std::exp(-0.04 * quantile), 0.003);
}

TEST(Reach, RangeIsZeroAtReserve) {
  const Forecaster f = forecaster(0.04, 0.2);
  const std::vector<PricedLeg> typical{drive(500)};
  const Reach r = reach(f, battery(), {0.1, 0, 0.15}, {sum_of(f, typical)});
  EXPECT_EQ(r.usable_j, 0);
  EXPECT_EQ(r.range_m[2], 0);
}

}  // namespace
}  // namespace joulecast::forecast
