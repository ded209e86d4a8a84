#include "telemetry/channel_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace joulecast::telemetry {
namespace {

using ::testing::HasSubstr;

signals::Sample sample_at(std::int64_t k) {
  signals::Sample sample;
  sample.utime_us = 1'700'000'000'000'000 + 20'000 * k;
  sample.sequence = k;
  sample.wheel_velocity_rad_s = {1.0 + static_cast<double>(k), 2};
  sample.battery_voltage_v = 24;
  return sample;
}

void send(ChannelWatch& watch, const std::string& channel, const std::string& robot_id,
          const signals::Sample& sample, const Sender& sender = {}) {
  const auto bytes = encode_telemetry(robot_id, sample).value();
  EXPECT_TRUE(watch.add(channel, bytes, sample.utime_us + 500, sender));
}

TEST(ChannelWatch, CountsRatesValuesAndGaps) {
  ChannelWatch watch;
  for (std::int64_t k = 0; k < 101; ++k)
    if (k < 50 || k >= 60) send(watch, "ROBOT_TELEMETRY.a", "a", sample_at(k));
  const ChannelTally& tally = watch.channels().at("ROBOT_TELEMETRY.a");
  EXPECT_EQ(tally.messages, 91u);
  EXPECT_NEAR(tally.rate_hz(), 45, 1e-9);
  EXPECT_EQ(tally.longest_silence_us, 220'000);
  EXPECT_EQ(tally.clock_ahead_us, -500);
  EXPECT_EQ(tally.sequence.missing, 10u);
  EXPECT_TRUE(tally.faults.empty());
  const auto& right = tally.fields[0];
  EXPECT_EQ(right.name, "wheel_velocity.right");
  EXPECT_EQ(right.changes, 90u);
  EXPECT_EQ(right.least, 1);
  EXPECT_EQ(right.last, 101);
  EXPECT_EQ(tally.fields[1].changes, 0u);
  EXPECT_EQ(tally.fields[2].measured, 0u);  // a motor's voltage that this robot does not measure
}

TEST(ChannelWatch, RateOmitsStepsOfClock) {
  ChannelWatch watch;
  for (std::int64_t k = 0; k < 50; ++k) watch.add("a", sample_at(k));
  for (std::int64_t k = 0; k < 50; ++k) {
    signals::Sample sample = sample_at(k);
    sample.utime_us = 10'000'000 + 20'000 * k;
    watch.add("a", sample);
  }
  EXPECT_NEAR(watch.channels().at("ROBOT_TELEMETRY.a").rate_hz(), 50, 1e-9);
}

TEST(ChannelWatch, CountsGapsInOrder) {
  ChannelWatch watch;
  for (const std::int64_t k : {0, 1, 3, 2, 4, 200, 201, 202, 202, 203, 400})
    send(watch, "ROBOT_TELEMETRY.a", "a", sample_at(k));
  EXPECT_EQ(watch.channels().at("ROBOT_TELEMETRY.a").gaps, 1u) << "the last waits for what follows";
  for (const std::int64_t k : {401, 402, 403}) send(watch, "ROBOT_TELEMETRY.a", "a", sample_at(k));
  EXPECT_EQ(watch.channels().at("ROBOT_TELEMETRY.a").gaps, 2u);
}

TEST(ChannelWatch, NamesRejectedSamples) {
  ChannelWatch watch;
  signals::Sample wild = sample_at(0);
  wild.battery_voltage_v = 24'000;
  send(watch, "ROBOT_TELEMETRY.a", "a", wild, {1, 1000});
  send(watch, "ROBOT_TELEMETRY.a", "b", sample_at(1), {2, 1000});
  const std::uint8_t rubbish[] = {1, 2, 3};
  EXPECT_TRUE(watch.add("MISSION_EVENT.a", rubbish, 0));
  EXPECT_FALSE(watch.add("SOMETHING.else", rubbish, 0));
  const ChannelTally& tally = watch.channels().at("ROBOT_TELEMETRY.a");
  EXPECT_EQ(tally.senders.size(), 2u);
  EXPECT_EQ(tally.faults.at("implausible").first, 1u);
  EXPECT_THAT(tally.faults.at("implausible").second, HasSubstr("battery_voltage"));
  EXPECT_THAT(tally.faults.at("wrong_channel").second, HasSubstr("\"b\""));
  EXPECT_EQ(watch.channels().at("MISSION_EVENT.a").faults.at("undecodable").first, 1u);
  EXPECT_EQ(watch.channels().size(), 2u);
}

}  // namespace
}  // namespace joulecast::telemetry
