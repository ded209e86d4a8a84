#include "telemetry/impossible.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "tests/support/sample_robots.h"

namespace joulecast::telemetry {
namespace {

using signals::Sample;

// A minute at 20 Hz: standing, then speeds that rise and fall. All channels follow the motion, with noise of
// this standard deviation.
Recording drive(const robot::RobotModel& robot, double noise_sd = 0.05) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const auto noise = [&] { return noise_sd * normal(random); };
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
    s.motor_voltage_v = {w + noise(), w + noise()};
    s.motor_current_a = {1 + w + noise(), 1 + w + noise()};
    s.battery_voltage_v = robot.battery.nominal_voltage_v;
    s.battery_current_a = 2 + w + noise();
    s.yaw_rate_rad_s = 0.2 * w + noise();
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

TEST(ImpossibleReadings, LoneExtremesAreDropped) {
  const Recording sound = drive(testing::nomad());
  for (const std::size_t number : followers)
    for (const double extreme : {-500.0, 655.35, -999.0, 9999.0, -3276.8, 65535.0, 4294967.295, 1e30}) {
      std::vector<Recording> one{sound};
      for (const std::size_t k : {0u, 1u, 2u, 300u, 301u, 700u})
        *signals::numbers_of(one[0].samples[k])[number] = extreme;
      const auto dropped = dropped_of(one);
      ASSERT_EQ(dropped.size(), 1u) << number << ' ' << extreme;
      EXPECT_EQ(dropped[0].samples, 6u);
      EXPECT_TRUE(std::isnan(*signals::numbers_of(one[0].samples[301])[number]));
    }
}

TEST(ImpossibleReadings, TwoExtremesAreDropped) {
  std::vector<Recording> one{drive(testing::nomad())};
  for (const std::size_t k : {300u, 301u, 302u, 303u, 304u})
    one[0].samples[k].battery_current_a = k % 2 == 0 ? 9999 : -500;
  const auto dropped = dropped_of(one);
  ASSERT_EQ(dropped.size(), 1u);
  EXPECT_EQ(dropped[0].samples, 5u);
}

// Beyond the limit and twice all others: it may be a reading until it returns exactly.
TEST(ImpossibleReadings, ReturningExtremesAreDropped) {
  std::vector<Recording> one{drive(testing::nomad())};
  for (const std::size_t k : {900u, 901u, 940u, 941u, 1000u}) one[0].samples[k].battery_current_a = -27;
  const auto dropped = dropped_of(one);
  ASSERT_EQ(dropped.size(), 1u);
  EXPECT_EQ(dropped[0].samples, 3u);
  EXPECT_EQ(one[0].samples[901].battery_current_a, -27);
}

// All but the first values of a signal in another unit remain: its unit is found by other checks.
TEST(ImpossibleReadings, VaryingExtremesAreSignals) {
  for (const std::size_t number : followers) {
    std::vector<Recording> one{drive(testing::nomad())};
    for (Sample& s : one[0].samples) *signals::numbers_of(s)[number] *= 1000;
    std::size_t samples = 0;
    for (const DroppedReadings& dropped : dropped_of(one)) samples += dropped.samples;
    EXPECT_LE(samples, 8u) << number;
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

// A robot that rolls with its motors off: neither voltage nor current, and no error of a sensor.
TEST(ImpossibleReadings, MotorOffIsNoError) {
  std::vector<Recording> one{drive(testing::nomad())};
  for (std::size_t k = 600; k < 720; ++k)
    one[0].samples[k].motor_voltage_v = one[0].samples[k].motor_current_a = {0, 0};
  EXPECT_TRUE(dropped_of(one).empty());
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

// The last row repeats from 30 s to 45 s. Without noise, constant motion explains that.
TEST(ImpossibleReadings, FrozenStreamsAreDropped) {
  for (const double noise : {0.05, 0.0}) {
    const Recording sound = drive(testing::nomad(), noise);
    std::vector<Recording> one{sound};
    for (std::size_t k = 600; k < 900; ++k) {
      one[0].samples[k] = sound.samples[599];
      one[0].samples[k].utime_us = sound.samples[k].utime_us;
    }
    const auto dropped = dropped_of(one);
    ASSERT_EQ(dropped.size(), noise > 0 ? 1u : 0u);
    if (noise == 0) continue;
    EXPECT_NE(dropped[0].why.find("the stream is frozen"), std::string::npos);
    EXPECT_NEAR(static_cast<double>(dropped[0].samples), 280, 2);
    EXPECT_EQ(one[0].samples.size() + dropped[0].samples, sound.samples.size());
  }
}

// A robot at rest may repeat its rows.
TEST(ImpossibleReadings, RestIsNotFrozen) {
  std::vector<Recording> one{drive(testing::nomad())};
  for (std::size_t k = 600; k < 900; ++k) {
    const std::int64_t utime_us = one[0].samples[k].utime_us;
    one[0].samples[k] = one[0].samples[50];
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
