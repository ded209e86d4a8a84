#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "asking.h"
#include "base/median.h"
#include "client/virtual_robot/rng.h"
#include "forecast/outlook.h"
#include "robots.h"

namespace joulecast::forecast {
namespace {

using virtual_robot::Rng;

// Energy, way and duration of motions, summed by their samples.
struct Sums {
  double energy_j = 0, way_m = 0, duration_s = 0;
};

// A robot's motion in steps, its power by a formula of its own, and the samples that the service receives.
class Driven {
 public:
  Driven(Rng& rng, double period_s, LegTracker& tracker) : rng_(rng), period_s_(period_s), tracker_(tracker) {
    friction_n_ = 14 * std::exp(0.02 * rng.normal());
    tracker_.begin();
  }

  void halt(double duration_s) { ramp(0, 0, duration_s); }
  void drive(double way_m, double speed_m_s) {
    const double ramp_s = 2 * speed_m_s;
    ramp(speed_m_s, 0, ramp_s);
    ramp(speed_m_s, 0, std::max(0.0, way_m / speed_m_s - ramp_s));
    ramp(0, 0, ramp_s);
  }
  void turn(double angle_rad) {
    ramp(0, 1, 0.8);
    ramp(0, 1, std::max(0.0, angle_rad - 0.8));
    ramp(0, 0, 0.8);
  }
  // Slower in curves, without a stop.
  void round(int straights) {
    for (int k = 0; k < straights; ++k) {
      ramp(1, 0, 2);
      ramp(1, 0, rng_.uniform(2, 12));
      ramp(0.35, 0.4, 2);
      ramp(0.35, 0.4, rng_.uniform(2, 6));
    }
    ramp(0, 0, 1);
  }
  const Sums& sums() const { return sums_; }

 private:
  void ramp(double speed_m_s, double yaw_rate_rad_s, double duration_s) {
    constexpr double step_s = 0.05, mass_kg = 70, idle_w = 25;
    const int steps = static_cast<int>(std::lround(duration_s / step_s));
    const double from = speed_, from_yaw = yaw_;
    for (int k = 1; k <= steps; ++k) {
      const double share = static_cast<double>(k) / steps;
      speed_ = std::lerp(from, speed_m_s, share), yaw_ = std::lerp(from_yaw, yaw_rate_rad_s, share);
      const double motor_w = (friction_n_ + mass_kg * (speed_m_s - from) / duration_s) * speed_ + 8 * yaw_;
      power_w_ = idle_w + (motor_w > 0 ? motor_w / 0.8 : 0.5 * motor_w);
      sums_.energy_j += power_w_ * step_s, sums_.way_m += speed_ * step_s, sums_.duration_s += step_s;
      since_j_ += power_w_ * step_s;
      if ((since_s_ += step_s) + 1e-9 < period_s_) continue;
      tracker_.add({first_ ? 0 : since_s_, speed_, yaw_, since_j_ / since_s_, 0});
      first_ = false;
      since_s_ = since_j_ = 0;
    }
  }

  Rng& rng_;
  double period_s_;
  LegTracker& tracker_;
  double friction_n_, speed_ = 0, yaw_ = 0, power_w_ = 0, since_s_ = 0, since_j_ = 0;
  bool first_ = true;
  Sums sums_;
};

void short_moves(Driven& robot, Rng& rng, int count) {
  for (int k = 0; k < count; ++k) {
    robot.turn(rng.uniform(0.5, 2.5));
    robot.drive(rng.uniform(0.8, 6), rng.uniform(0.5, 1.1));
  }
}

// Held-out missions cost an energy in a time and over a way that their samples sum: until the charge is used,
// the robot runs and drives as their sums say.
TEST(TypicalDriving, RunsAndDrivesAsForecast) {
  struct Kind {
    const char* name;
    double period_s;
    std::function<void(Driven&, Rng&)> mission;
  };
  const auto mixed = [](Driven& robot, Rng& rng) {
    for (int k = 0; k < 3; ++k) {
      robot.round(static_cast<int>(rng.uniform(2, 10)));
      short_moves(robot, rng, 3);
    }
  };
  const std::vector<Kind> kinds{
      {"rounds and short moves", 0.1, mixed},
      {"rounds and short moves, 1 Hz", 1, mixed},
      {"short moves", 0.1, [](Driven& robot, Rng& rng) { short_moves(robot, rng, 12); }},
      {"long waits", 0.1, [](Driven& robot, Rng& rng) {
         for (int k = 0; k < 4; ++k) {
           short_moves(robot, rng, 2);
           if (rng.uniform() < 0.7) robot.halt(std::exp(3.5 + 0.8 * rng.normal()));
         }
       }}};
  const robot::RobotModel file = shipped("amr");
  const dynamics::DriveModel drive = *dynamics::drive_model(file);
  const ChargeMap battery{battery::Circuit(file.battery)};
  const LegPricer pricer(file, drive);
  for (const Kind& kind : kinds) {
    constexpr std::size_t robots = 12, learnt = 12, held_out = 200;
    std::size_t time_inside = 0, range_inside = 0;
    std::vector<double> time_error, range_error;
    double width = 0;
    for (std::size_t r = 0; r < robots; ++r) {
      Rng rng(7000 + r);
      LegTracker tracker(file);
      RobotForecast forecast(file, drive);
      Sums truth;
      for (std::size_t m = 0; m < learnt + held_out; ++m) {
        Driven robot(rng, kind.period_s, tracker);
        kind.mission(robot, rng);
        robot.halt(1.5);
        if (m < learnt) {
          forecast.learn({static_cast<std::int64_t>(1 + m) * 1'000'000'000, tracker.take()});
          continue;
        }
        truth.energy_j += robot.sums().energy_j;
        truth.way_m += robot.sums().way_m;
        truth.duration_s += robot.sums().duration_s;
      }
      const auto f = forecast.forecaster();
      const Reach reach = forecast::reach(*f, battery, {0.8, 0, 0.15}, typical_driving(*f, pricer, {}, 0));
      const double time_s = reach.usable_j * truth.duration_s / truth.energy_j,
                   range_m = reach.usable_j * truth.way_m / truth.energy_j;
      time_inside += reach.run_time_s[0] <= time_s && time_s <= reach.run_time_s[2];
      range_inside += reach.range_m[0] <= range_m && range_m <= reach.range_m[2];
      time_error.push_back(reach.run_time_s[1] / time_s - 1);
      range_error.push_back(reach.range_m[1] / range_m - 1);
      width += (reach.run_time_s[2] - reach.run_time_s[0]) / reach.run_time_s[1] / robots;
      EXPECT_NEAR(reach.mean_power_w * reach.run_time_s[1], reach.usable_j, 1e-9 * reach.usable_j);
      EXPECT_NEAR(reach.energy_per_m_j * reach.range_m[1], reach.usable_j, 1e-9 * reach.usable_j);
    }
    std::printf("%s: run time %+.1f %%, %zu inside of %zu, width %.0f %%; range %+.1f %%, %zu inside\n",
                kind.name, 100 * upper_median(time_error), time_inside, robots, 100 * width,
                100 * upper_median(range_error), range_inside);
    const std::size_t least = expected_hits(robots, 0.9)[0];
    EXPECT_GE(time_inside, least) << kind.name;
    EXPECT_GE(range_inside, least) << kind.name;
    EXPECT_LT(std::fabs(upper_median(time_error)), 0.03) << kind.name;
    EXPECT_LT(std::fabs(upper_median(range_error)), 0.03) << kind.name;
    EXPECT_LT(width, 0.35) << kind.name;
  }
}

}  // namespace
}  // namespace joulecast::forecast
