#include "telemetry/impossible.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "tests/support/sample_robots.h"

namespace joulecast::telemetry {
namespace {

using signals::Sample;

// A minute at 20 Hz: standing, then speeds that rise and fall. All channels follow the motion with noise.
Recording drive(const robot::RobotModel& robot) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 0.05);
  Recording recording;
  recording.robot_id = robot.robot_id;
  const double top_rad_s = robot.limits.speed_m_s / robot.kinematics.wheel_radius_m;
  for (std::int64_t k = 0; k < 1200; ++k) {
    const double t = 0.05 * static_cast<double>(k);
    Sample s;
    s.utime_us = 1'700'000'000'000'000 + 50'000 * k;
    s.sequence = k;
    const double w = t < 5 ? 0 : 0.5 * top_rad_s * (1 - std::cos(t - 5));
    s.wheel_velocity_rad_s = {w, 0.5 * w};
    s.motor_voltage_v = {w + noise(random), w + noise(random)};
    s.motor_current_a = {1 + w + noise(random), 1 + w + noise(random)};
    s.battery_voltage_v = robot.battery.nominal_voltage_v;
    s.battery_current_a = 2 + w + noise(random);
    s.yaw_rate_rad_s = 0.2 * w + noise(random);
    recording.samples.push_back(s);
  }
  return recording;
}

std::vector<DroppedReadings> dropped_of(std::vector<Recording>& recordings) {
  return drop_impossible(recordings, testing::nomad());
}

constexpr std::array<std::size_t, 6> followers{2, 3, 4, 5, 7, 10};  // of signals::numbers_of

TEST(ImpossibleReadings, SoundChannelsRemain) {
  std::vector<Recording> one{drive(testing::nomad())};
  EXPECT_TRUE(dropped_of(one).empty());
}

TEST(ImpossibleReadings, EndsOfCountersAreDropped) {
  const Recording sound = drive(testing::nomad());
  for (const std::size_t number : followers)
    for (const double end :
         {-32.768, 65.535, 327.67, 655.35, -999.0, 9999.0, -3276.8, 65535.0, -2147483.648, 4294967.295}) {
      std::vector<Recording> one{sound};
      for (const std::size_t k : {300u, 301u, 700u}) *signals::numbers_of(one[0].samples[k])[number] = end;
      const auto dropped = dropped_of(one);
      ASSERT_EQ(dropped.size(), 1u) << number << ' ' << end;
      EXPECT_EQ(dropped[0].samples, 3u);
      EXPECT_TRUE(std::isnan(*signals::numbers_of(one[0].samples[301])[number]));
      for (const double near : {0.999 * end, 1.001 * end}) {
        *signals::numbers_of(one[0].samples[300])[number] = near;
        EXPECT_TRUE(dropped_of(one).empty()) << near;
      }
    }
}

TEST(ImpossibleReadings, FrozenChannelsAreDropped) {
  const Recording sound = drive(testing::nomad());
  for (const std::size_t number : followers) {
    std::vector<Recording> one{sound};
    // Frozen from 30 s to 36 s, nearly a period of the motion; the value is the last one before, or 0.
    for (const bool zero : {false, true}) {
      one[0] = sound;
      for (std::size_t k = 600; k < 720; ++k)
        *signals::numbers_of(one[0].samples[k])[number] =
            zero ? 0 : *signals::numbers_of(sound.samples[599])[number];
      const auto dropped = dropped_of(one);
      ASSERT_EQ(dropped.size(), 1u) << number;
      EXPECT_NE(dropped[0].why.find(dropped[0].channel + " is frozen at"), std::string::npos);
      std::size_t unmeasured = 0;
      for (std::size_t k = 0; k < sound.samples.size(); ++k)
        for (const std::size_t other : followers) {
          const bool is_nan = std::isnan(*signals::numbers_of(one[0].samples[k])[other]);
          EXPECT_FALSE(is_nan && (other != number || k < 600 || k >= 720)) << k << ' ' << other;
          unmeasured += is_nan;
        }
      EXPECT_EQ(dropped[0].samples, unmeasured);
      // At least a second passes, and the motion changes by a quarter of the limit within two.
      EXPECT_GT(unmeasured, 75u) << number;
      EXPECT_LE(unmeasured, 101u) << number;
    }
  }
}

TEST(ImpossibleReadings, SlowChannelsAreNotFrozen) {
  const Recording sound = drive(testing::nomad());
  for (const std::size_t rows : {10u, 40u}) {  // a reading in 0.5 s, and in 2 s
    std::vector<Recording> one{sound};
    for (std::size_t k = 0; k < sound.samples.size(); ++k)
      for (const std::size_t number : followers)
        *signals::numbers_of(one[0].samples[k])[number] =
            *signals::numbers_of(sound.samples[k - k % rows])[number];
    EXPECT_TRUE(dropped_of(one).empty()) << rows;
  }
}

// Simulated currents are constant at constant speed.
TEST(ImpossibleReadings, ConstantMotionExplainsConstants) {
  std::vector<Recording> one{drive(testing::nomad())};
  for (std::size_t k = 600; k < 900; ++k) {
    const std::int64_t utime_us = one[0].samples[k].utime_us;
    one[0].samples[k] = one[0].samples[599];
    one[0].samples[k].utime_us = utime_us;
  }
  EXPECT_TRUE(dropped_of(one).empty());
}

TEST(ImpossibleReadings, ZeroWhileMovingIsDropped) {
  const Recording sound = drive(testing::nomad());
  for (const bool moves : {true, false})
    for (const std::size_t number : followers) {
      std::vector<Recording> one{sound};
      for (std::size_t k = 600; k < 700; ++k) {
        Sample& s = one[0].samples[k];
        const std::int64_t utime_us = s.utime_us;
        s = sound.samples[moves ? 560 : 50];  // at constant speed, or standing
        s.utime_us = utime_us;
        *signals::numbers_of(s)[number] = 0;
      }
      const auto dropped = dropped_of(one);
      ASSERT_EQ(dropped.size(), moves ? 1u : 0u) << number;
      for (const DroppedReadings& one_channel : dropped)
        EXPECT_NEAR(static_cast<double>(one_channel.samples), 80, 2) << number;
    }
}

TEST(ImpossibleReadings, VoltagesOutsideThePackAreDropped) {
  const robot::RobotModel robot = testing::nomad();
  for (const double share : {0.0, 0.25, 0.5, 0.59, 1.51, 2.0}) {
    std::vector<Recording> one{drive(robot)};
    for (std::size_t k = 300; k < 340; ++k)
      one[0].samples[k].battery_voltage_v = share * robot.battery.nominal_voltage_v;
    const auto dropped = dropped_of(one);
    ASSERT_EQ(dropped.size(), 1u) << share;
    EXPECT_EQ(dropped[0].channel, "battery_voltage");
    EXPECT_EQ(dropped[0].samples, 40u);
    EXPECT_TRUE(std::isnan(one[0].samples[320].battery_current_a));
    EXPECT_TRUE(std::isfinite(one[0].samples[340].battery_current_a));
  }
}

}  // namespace
}  // namespace joulecast::telemetry
