#include "forecast/habit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "forecast/leg_cost.h"
#include "robots.h"

namespace joulecast::forecast {
namespace {

Leg driven(Motion motion, double way, Cruise cruise) {
  cruise.speed = std::min(cruise.speed, std::sqrt(way * cruise.acceleration));
  return {motion, way / cruise.speed + cruise.speed / cruise.acceleration, way, cruise.speed, 0, 0, 0};
}

Leg halt(double duration_s) {
  return {Motion::stand, duration_s, 0, 0, 0, 0, 0};
}

double mean_duration_s(const Habit& habit, LegKind kind, double way) {
  double sum = 0;
  for (const Cruise& cruise : habit.cruises[static_cast<std::size_t>(kind)])
    sum += driven(kind == LegKind::turn ? Motion::turn : Motion::drive, way, cruise).duration_s;
  return sum / static_cast<double>(habit.cruises[static_cast<std::size_t>(kind)].size());
}

TEST(Habit, KeepsMeanDurationOfLegs) {
  const robot::RobotModel robot = shipped("amr");
  PastMission mission;
  double drives_s = 0, turns_s = 0;
  constexpr int legs = 40;
  for (int k = 0; k < legs; ++k) {
    const double scale = 0.4 + 0.03 * k;
    mission.legs.push_back(driven(Motion::turn, 6, {0.8 * scale, 2}));
    turns_s += mission.legs.back().duration_s;
    mission.legs.push_back(driven(Motion::drive, 20, {scale, 0.5}));
    drives_s += mission.legs.back().duration_s;
  }
  const Habit habit = habit_of(robot, std::span(&mission, 1));
  EXPECT_NEAR(mean_duration_s(habit, LegKind::straight, 20), drives_s / legs, 0.01 * drives_s / legs);
  EXPECT_NEAR(mean_duration_s(habit, LegKind::turn, 6), turns_s / legs, 0.01 * turns_s / legs);
  EXPECT_EQ(habit.middle.pause_s, 0);
}

// Of the cruises 0.4 to 1.5, the faster ones are not reached on 1 m: their share is taken from long legs.
TEST(Habit, IgnoresLegsWithoutCruise) {
  const robot::RobotModel robot = shipped("amr");
  PastMission mixed, longer;
  for (int k = 0; k < 40; ++k) {
    const Cruise cruise{0.4 + 0.0275 * k, 0.5};
    longer.legs.push_back(driven(Motion::drive, 20, cruise));
    mixed.legs.push_back(longer.legs.back());
    mixed.legs.push_back(driven(Motion::drive, 1, cruise));
  }
  const double truth_s = mean_duration_s(habit_of(robot, std::span(&longer, 1)), LegKind::straight, 20);
  EXPECT_NEAR(mean_duration_s(habit_of(robot, std::span(&mixed, 1)), LegKind::straight, 20), truth_s,
              0.03 * truth_s);
}

TEST(Habit, CountsHaltsByFrequency) {
  const robot::RobotModel robot = shipped("amr");
  std::vector<PastMission> missions(10);
  for (PastMission& mission : missions) {
    mission.legs.push_back(halt(1));  // before the first leg: added to the halt after its last
    for (int k = 0; k < 10; ++k) {
      mission.legs.push_back(driven(Motion::turn, 2, {1, 2}));
      mission.legs.push_back(driven(Motion::drive, 8, {0.8, 0.5}));
      if (k == 4) mission.legs.push_back(halt(3));
    }
    mission.legs.push_back(halt(2));
  }
  const Habit habit = habit_of(robot, missions);
  EXPECT_EQ(habit.halts[0].legs, 100);
  EXPECT_NEAR(habit.halts[0].share, 0.2, 1e-12);
  EXPECT_NEAR(habit.halts[0].mean_s, 0.6, 1e-12);
  EXPECT_EQ(habit.halts[1].mean_s, 0);
  EXPECT_NEAR(habit.middle.pause_s, 0.3, 1e-12);
  // As regular as these are, they scatter less than independent halts.
  EXPECT_LT(habit.halt_dispersion, 1);
  const HaltDistribution ten = habit.standing({10, 10}, 2);
  EXPECT_NEAR(ten.mean(), 12, 1e-12);
  EXPECT_NEAR(ten.probability_of_none(), std::pow(0.8, 10), 1e-12);
  EXPECT_TRUE(habit.standing({0, 10}, 2).none());
}

// Means of shares of 1 may round to above 1.
TEST(Habit, KindsMayAlwaysHalt) {
  const robot::RobotModel robot = shipped("amr");
  PastMission mission;
  for (int k = 0; k < 10; ++k) {
    mission.legs.push_back(driven(Motion::drive, 8, {0.8, 0.5}));
    mission.legs.push_back(halt(1 + 0.1 * k));
  }
  const Habit one = habit_of(robot, std::span(&mission, 1));
  for (std::size_t robots = 1; robots <= 40; ++robots) {
    const Habit kind = habit_of_kind(std::vector<const Habit*>(robots, &one));
    for (const Habit& habit : {kind, habit_of(robot, std::span(&mission, 1), &kind)}) {
      const HaltDistribution halts = habit.standing({10, 0}, 1);
      EXPECT_LT(halts.probability_of_none(), 1e-9) << robots;
      EXPECT_NEAR(halts.mean(), 14.5, 1e-9) << robots;
    }
  }
}

TEST(Habit, StatedPaceReplacesHabit) {
  const robot::RobotModel robot = shipped("amr");
  const Habit habit = habit_of(robot, {});
  EXPECT_EQ(habit.middle.speed_m_s, default_pace(robot).speed_m_s);
  StatedPace stated;
  stated.speed_m_s = 0.5;
  EXPECT_TRUE(stated.cruise(Motion::drive));
  EXPECT_FALSE(stated.whole(Motion::drive));
  EXPECT_FALSE(stated.cruise(Motion::turn));
  EXPECT_TRUE(stated.whole(Motion::stand));
  stated.acceleration_m_s2 = 0.3;
  EXPECT_TRUE(stated.whole(Motion::drive));
  const Habit with = habit.with(stated);
  for (const LegKind kind : {LegKind::straight, LegKind::curve}) {
    ASSERT_EQ(with.cruises[static_cast<std::size_t>(kind)].size(), 1u);
    EXPECT_EQ(with.cruises[static_cast<std::size_t>(kind)][0].speed, 0.5);
  }
}

// Rare and long: the median plan does not halt at all, one in ten halts for long.
TEST(Prediction, RareHaltsWidenTheTail) {
  const ScoreDistribution scores;
  Prediction p;
  p.legs = 100;
  p.spread = 0.01;
  p.scores = &scores;
  p.halts = HaltDistribution(3, 100, 0.9);
  EXPECT_NEAR(p.quantile(0.5), 100.2, 0.5);
  EXPECT_GT(p.quantile(0.97), 120);
  EXPECT_NEAR(p.expected(), 103, 1e-9);
  for (const double probability : {0.1, 0.5, 0.8, 0.95})
    EXPECT_NEAR(p.probability_below(p.quantile(probability)), probability, 0.01);
  EXPECT_NEAR(p.score_of(p.quantile(0.5)), scores.quantile(0.5), 0.01);
}

// Halts, more legs and what is known exactly only add; of a plan without legs the median stands where more
// than half of all do not halt.
TEST(Prediction, QuantilesGrowWithEveryPart) {
  const ScoreDistribution scores;
  std::mt19937_64 random(7);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  for (int k = 0; k < 300; ++k) {
    Prediction p;
    p.fixed = k % 3 == 0 ? 0 : between(0, 50);
    p.legs = k % 3 == 1 ? 0 : between(1, 100);
    p.spread = between(0.01, 0.2), p.inflation = between(0.7, 1.5);
    p.scores = &scores;
    Prediction halting = p, farther = p, later = p;
    const double none = between(0.1, 0.9), mean = between(0.1, 20);
    halting.halts = farther.halts = later.halts = HaltDistribution(mean, mean * mean * between(1, 4), none);
    farther.legs *= 1.3;
    later.fixed += 5;
    double before = 0;
    for (const double probability : {0.05, 0.25, 0.5, 0.75, 0.95}) {
      const double with = halting.quantile(probability), close = 1e-4 * with;
      EXPECT_GE(with, before - close);
      EXPECT_GE(with, p.quantile(probability) - close);
      EXPECT_LE(with, p.quantile(probability) + halting.halts.values().back() + close);
      EXPECT_GE(farther.quantile(probability), with - close);
      EXPECT_GE(later.quantile(probability), with - close);
      before = with;
    }
    if (p.legs == 0 && none > 0.6) {
      EXPECT_NEAR(halting.quantile(0.5), p.fixed, 1e-4 * p.fixed);
    }
  }
}

// Two robots drive at 0.4 and 0.8 m/s and halt for 2 s after each and after no drive; a third is new.
TEST(Habit, NewRobotsDriveLikeTheirKind) {
  const robot::RobotModel robot = shipped("amr");
  PastMission slow, fast;
  for (int k = 0; k < 20; ++k) {
    slow.legs.push_back(driven(Motion::drive, 20, {0.4, 0.5}));
    slow.legs.push_back(halt(2));
    fast.legs.push_back(driven(Motion::drive, 20, {0.8, 0.5}));
  }
  const Habit a = habit_of(robot, std::span(&slow, 1)), b = habit_of(robot, std::span(&fast, 1));
  const Habit* const both[] = {&a, &b};
  const Habit kind = habit_of_kind(both);
  const Habit newcomer = habit_of(robot, {}, &kind);
  const double middle_s = 0.5 * (slow.legs[0].duration_s + fast.legs[0].duration_s);
  EXPECT_NEAR(mean_duration_s(newcomer, LegKind::straight, 20), middle_s, 0.01 * middle_s);
  EXPECT_NEAR(newcomer.halts[0].share, 0.5, 1e-9);
  EXPECT_NEAR(newcomer.halts[0].mean_s, 1, 1e-9);
  EXPECT_NEAR(newcomer.halts[0].variance_s2, 1, 1e-9);
  // Drives and halts of its kind count as five; all of its drives, as five more of its straight ones.
  PastMission own;
  for (int k = 0; k < 15; ++k) own.legs.push_back(driven(Motion::drive, 20, {1, 0.5}));
  const Habit known = habit_of(robot, std::span(&own, 1), &kind);
  const double own_s = own.legs[0].duration_s, kinds_share = 5.0 / 20 * 5 / 20;
  EXPECT_NEAR(mean_duration_s(known, LegKind::straight, 20), own_s + kinds_share * (middle_s - own_s), 0.1);
  EXPECT_NEAR(known.halts[0].mean_s, 5.0 / 20, 1e-9);
}

// The shares of some numbers of robots that halt after every drive sum to more than 1 by rounding.
TEST(Habit, KindsThatAlwaysHaltHaveProbabilities) {
  const robot::RobotModel robot = shipped("amr");
  PastMission mission;
  for (int k = 0; k < 6; ++k) {
    mission.legs.push_back(driven(Motion::drive, 20, {0.4, 0.5}));
    mission.legs.push_back(halt(2));
  }
  const Habit one = habit_of(robot, std::span(&mission, 1));
  for (std::size_t robots = 1; robots <= 60; ++robots) {
    const Habit kind = habit_of_kind(std::vector(robots, &one));
    const Habit newcomer = habit_of(robot, {}, &kind);
    EXPECT_NEAR(newcomer.standing({3, 0}, 1).probability_of_none(), 0, 1e-12) << robots;
    EXPECT_NEAR(newcomer.halts[0].variance_s2, 0, 1e-9) << robots;
  }
}

}  // namespace
}  // namespace joulecast::forecast
