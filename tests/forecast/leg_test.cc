#include "forecast/leg.h"

#include <gtest/gtest.h>

#include <cmath>

#include "robots.h"

namespace joulecast::forecast {
namespace {

constexpr double h = 0.01;

// Drives a trapezoid along the way or in place, sample by sample; speeds are linear between samples where
// ramps and cruise take whole steps, so that integrals are exact but for the corners.
class Drive {
 public:
  explicit Drive(LegTracker& tracker) : tracker_(tracker) { sample(0, 0); }

  void trapezoid(double speed, double ramp_s, double cruise_s, bool turning, double curvature_1_m = 0) {
    const int count = static_cast<int>(std::lround((2 * ramp_s + cruise_s) / h));
    for (int k = 1; k <= count; ++k) {
      const double t = k * h, left = 2 * ramp_s + cruise_s - t;
      const double v = speed * std::min({1.0, t / ramp_s, left / ramp_s});
      turning ? sample(0, v) : sample(v, v * curvature_1_m);
    }
  }
  void stand(double duration_s) {
    for (int k = 0; k < std::lround(duration_s / h); ++k) sample(0, 0);
  }
  void sample(double speed, double yaw) {
    tracker_.add({started_ ? h : 0, speed, yaw, 20 + 30 * std::fabs(speed), payload_kg});
    started_ = true;
  }
  double payload_kg = 5;

 private:
  LegTracker& tracker_;
  bool started_ = false;
};

TEST(LegTracker, CutsAtStops) {
  LegTracker tracker(shipped("amr"));
  tracker.begin();
  Drive drive(tracker);
  drive.stand(1);
  drive.trapezoid(0.8, 2, 3, true);
  drive.stand(0.5);
  drive.trapezoid(1.2, 2, 4, false, 0.25);
  drive.stand(2);
  const std::vector<Leg> legs = tracker.take();
  ASSERT_EQ(legs.size(), 5u);
  const Motion expected[] = {Motion::stand, Motion::turn, Motion::stand, Motion::drive, Motion::stand};
  for (std::size_t k = 0; k < 5; ++k) EXPECT_EQ(legs[k].motion, expected[k]) << k;
  // A leg lacks the way below the still speed, at most still^2 / a.
  const double still = still_speed_m_s(shipped("amr"));
  EXPECT_NEAR(legs[3].way, 1.2 * 6, still * still / 0.6 + still * h);
  EXPECT_NEAR(legs[3].duration_s, 8, 2 * still / 0.6 + 2 * h);
  EXPECT_NEAR(legs[3].speed, 1.2, 1.2 * 2 * (2 * still / 0.6 + 2 * h) / 8);
  EXPECT_NEAR(legs[3].curvature_1_m, 0.25, 1e-12);
  // Turning, the rims creep: the same way of theirs is rad at half the track.
  const double rim_still = still / shipped("amr").kinematics.half_track_m;
  EXPECT_NEAR(legs[1].way, 0.8 * 5, rim_still * rim_still / 0.4 + rim_still * h);
  EXPECT_NEAR(legs[1].duration_s, 7, 2 * rim_still / 0.4 + 2 * h);
  // The cruise is read from way, duration and integral of speed^2: an error of a share e of the duration is
  // one of at most 2 e, as v = (2 d - sqrt(4 d^2 - 3 T Q)) / T.
  EXPECT_NEAR(legs[1].speed, 0.8, 0.8 * 2 * (2 * rim_still / 0.4 + 2 * h) / 7);
  EXPECT_EQ(legs[3].payload_kg, 5);
  double energy = 0, duration = 0;
  for (const Leg& leg : legs) energy += leg.battery_j, duration += leg.duration_s;
  EXPECT_NEAR(duration, 1 + 7 + 0.5 + 8 + 2, 1e-9);
  EXPECT_NEAR(energy, 20 * duration + 30 * 1.2 * 6, 1e-9);
}

TEST(LegTracker, MergesShortInterruptions) {
  LegTracker tracker(shipped("amr"));
  Drive drive(tracker);
  drive.stand(2);
  for (int k = 0; k < 5; ++k) drive.sample(0.3, 0);  // 50 ms, shorter than settle_s
  drive.stand(2);
  const std::vector<Leg> legs = tracker.take();
  ASSERT_EQ(legs.size(), 1u);
  EXPECT_EQ(legs[0].motion, Motion::stand);
}

TEST(LegTracker, MarksChangesAndUnmeasuredPower) {
  LegTracker tracker(shipped("amr"));
  Drive drive(tracker);
  drive.stand(1);
  drive.payload_kg = 9;
  drive.stand(1);
  tracker.add({h, 0, 0, std::nan(""), 9});
  const std::vector<Leg> legs = tracker.take();
  ASSERT_EQ(legs.size(), 2u);
  EXPECT_EQ(legs[0].payload_kg, 5);
  EXPECT_EQ(legs[1].payload_kg, 9);
  EXPECT_TRUE(std::isfinite(legs[0].battery_j));
  EXPECT_TRUE(std::isnan(legs[1].battery_j));
}

TEST(LegTracker, GapInterruptsTheLeg) {
  LegTracker tracker(shipped("amr"));
  Drive drive(tracker);
  drive.stand(1);
  tracker.add({0, 0, 0, 20, 5});
  drive.stand(1);
  double duration = 0;
  for (const Leg& leg : tracker.take()) duration += leg.duration_s;
  EXPECT_NEAR(duration, 2, 1e-9);
}

TEST(LegTracker, TakeStartsNewLegs) {
  LegTracker tracker(shipped("amr"));
  Drive drive(tracker);
  drive.stand(1);
  EXPECT_EQ(tracker.take().size(), 1u);
  EXPECT_TRUE(tracker.take().empty());
}

// The robot follows its commands 0.2 s late, with gentler ramps, and stops 8 mm short.
TEST(LegTracker, ReadsPlansFromCommands) {
  LegTracker tracker(shipped("amr"));
  tracker.begin();
  const auto trapezoid = [](double t, double speed, double ramp_s, double cruise_s) {
    return speed * std::max(0.0, std::min({1.0, t / ramp_s, (2 * ramp_s + cruise_s - t) / ramp_s}));
  };
  const double v = 0.8, short_m = 0.008, ramp_s = 2, late_ramp_s = 2.5, late_s = 0.2;
  const double cruise_s = 4, late_cruise_s = (v * (ramp_s + cruise_s) - short_m) / v - late_ramp_s;
  for (int k = 0; k <= std::lround(14 / h); ++k) {
    const double t = k * h - 1;
    tracker.add({k == 0 ? 0 : h,
                 trapezoid(t - late_s, v, late_ramp_s, late_cruise_s),
                 0,
                 50,
                 0,
                 {trapezoid(t, v, ramp_s, cruise_s), 0}});
  }
  const std::vector<Leg> legs = tracker.take();
  ASSERT_EQ(legs.size(), 3u);
  EXPECT_EQ(legs[1].motion, Motion::drive);
  const double still = still_speed_m_s(shipped("amr"));
  EXPECT_NEAR(legs[1].planned_way, v * (ramp_s + cruise_s), 1e-3);
  EXPECT_NEAR(legs[1].planned_speed, v, 1e-9);
  EXPECT_NEAR(legs[1].planned_s, 2 * ramp_s + cruise_s, still * ramp_s / v + 2 * h);
  EXPECT_NEAR(legs[1].planned_way - legs[1].way, short_m, 2e-3);
  // From the command to the stop.
  EXPECT_NEAR(legs[1].duration_s, late_s + 2 * late_ramp_s + late_cruise_s,
              still * (ramp_s + late_ramp_s) / v + 2 * h);
  EXPECT_EQ(legs[0].planned_way, 0);
}

// Commands to drive, turn and drive without halts between them, followed 0.3 s late.
TEST(LegTracker, NextPlansPrecedeStops) {
  LegTracker tracker(shipped("amr"));
  tracker.begin();
  constexpr double v = 0.8, yaw = 1, ramp_s = 1, cruise_s = 2, leg_s = 2 * ramp_s + cruise_s, late_s = 0.3;
  const auto trapezoid = [](double t) {
    return std::max(0.0, std::min({1.0, t / ramp_s, (leg_s - t) / ramp_s}));
  };
  const auto command = [&](double t) {
    return std::array{v * (trapezoid(t) + trapezoid(t - 2 * leg_s)), yaw * trapezoid(t - leg_s)};
  };
  for (int k = 0; k <= std::lround((3 * leg_s + 2) / h); ++k) {
    const double t = k * h - 1;
    const auto [speed, yaw_rate] = command(t - late_s);
    tracker.add({k == 0 ? 0 : h, speed, yaw_rate, 50, 0, command(t)});
  }
  const std::vector<Leg> legs = tracker.take();
  ASSERT_EQ(legs.size(), 5u);
  const double still = still_speed_m_s(shipped("amr"));
  for (const std::size_t k : {1, 2, 3}) {
    EXPECT_NEAR(legs[k].planned_way, (k == 2 ? yaw : v) * (ramp_s + cruise_s), 2e-3) << k;
    EXPECT_NEAR(legs[k].planned_s, leg_s, 2 * still * ramp_s / v + 2 * h) << k;
  }
}

TEST(LegTracker, BlockedRobotsStand) {
  LegTracker tracker(shipped("amr"));
  tracker.begin();
  for (int k = 0; k < 500; ++k) tracker.add({k == 0 ? 0 : h, 0, 0, 50, 0, {k > 100 ? 0.5 : 0.0, 0}});
  for (const Leg& leg : tracker.take()) EXPECT_EQ(leg.motion, Motion::stand);
}

}  // namespace
}  // namespace joulecast::forecast
