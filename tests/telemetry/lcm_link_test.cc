#include "telemetry/lcm_link.h"

#include <gtest/gtest.h>

#include <regex>
#include <stdexcept>
#include <thread>
#include <vector>

#include "samples.h"
#include "signals/ids.h"
#include "telemetry/codec.h"
#include "telemetry/recording.h"
#include "temporary_file.h"

namespace joulecast::telemetry {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

LcmLink memory_link() {
  return LcmLink::open("memq://").value();
}

TEST(LcmLink, CarriesBytesOfMatchingChannelsOnly) {
  LcmLink link = memory_link();
  std::vector<std::pair<std::string, Bytes>> heard;
  ASSERT_TRUE(link.subscribe(channel_pattern(Subject::telemetry), [&](const Received& message) {
    heard.emplace_back(std::string(message.channel), Bytes(message.data.begin(), message.data.end()));
    EXPECT_GT(message.recv_utime_us, 1'600'000'000'000'000);
  }));
  ASSERT_TRUE(link.publish("ROBOT_TELEMETRY.a", Bytes{1, 2}));
  ASSERT_TRUE(link.publish("XROBOT_TELEMETRY.a", Bytes{3}));
  ASSERT_TRUE(link.publish("ROBOT_TELEMETRY_a", Bytes{4}));
  ASSERT_TRUE(link.publish("MISSION_EVENT.a", Bytes{5}));
  while (link.poll(0ms).value() > 0) {
  }
  ASSERT_EQ(heard.size(), 1u);
  EXPECT_EQ(heard[0].first, "ROBOT_TELEMETRY.a");
  EXPECT_EQ(heard[0].second, (Bytes{1, 2}));
}

TEST(LcmLink, HandlesABatchInOnePollAndRespectsItsBound) {
  LcmLink link = memory_link();
  int heard = 0;
  ASSERT_TRUE(link.subscribe("c", [&](const Received&) { ++heard; }));
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(link.publish("c", Bytes{1}));
  EXPECT_EQ(link.poll(100ms, 7).value(), 7);
  EXPECT_EQ(link.poll(100ms).value(), 3);
  EXPECT_EQ(heard, 10);
}

TEST(LcmLink, PollTimesOut) {
  LcmLink link = memory_link();
  EXPECT_EQ(link.poll(1ms).value(), 0);
}

TEST(LcmLink, WakeEndsAWaitOfAnotherThread) {
  LcmLink link = memory_link();
  const auto begin = std::chrono::steady_clock::now();
  std::thread waker([&] {
    std::this_thread::sleep_for(20ms);
    link.wake();
  });
  EXPECT_EQ(link.poll(60s).value(), 0);
  waker.join();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 30s);
  EXPECT_EQ(link.poll(1ms).value(), 0);  // the wake-up is used up
}

TEST(LcmLink, ExceptionOfAHandlerLeavesThroughPollAndTheLinkLivesOn) {
  LcmLink link = memory_link();
  int heard = 0;
  ASSERT_TRUE(link.subscribe("c", [&](const Received&) {
    if (++heard == 1) throw std::runtime_error("handler");
  }));
  ASSERT_TRUE(link.publish("c", Bytes{1}));
  ASSERT_TRUE(link.publish("c", Bytes{2}));
  EXPECT_THROW((void)link.poll(100ms), std::runtime_error);
  EXPECT_EQ(link.poll(100ms).value(), 1);
  EXPECT_EQ(heard, 2);
}

TEST(LcmLink, MovesWithItsSubscriptions) {
  LcmLink first = memory_link();
  int heard = 0;
  ASSERT_TRUE(first.subscribe("c", [&](const Received&) { ++heard; }));
  LcmLink second = std::move(first);
  ASSERT_TRUE(second.publish("c", Bytes{1}));
  EXPECT_EQ(second.poll(100ms).value(), 1);
  EXPECT_EQ(heard, 1);
}

TEST(LcmLink, RefusesBadProvidersPatternsAndChannels) {
  EXPECT_EQ(LcmLink::open("nonsense://").error().fault, Fault::unavailable);
  EXPECT_FALSE(memory_link().subscribe(
      "c", [](const Received&) {}, 0));
}

// The longest robot id still fits LCM's channel names, over the provider that is strictest about them.
TEST(LcmLink, LongestRobotIdMakesAValidChannel) {
  EXPECT_EQ(channel_of(Subject::telemetry, std::string(signals::max_robot_id_length, 'r')).size(), 63u);
}

TEST(LcmLink, ReplaysALogAndTellsItsEnd) {
  const test::TemporaryFile file;
  Recording recording{"amr-07", "m-1", 3.0, {test::distinct_sample(), test::distinct_sample()}};
  recording.samples[1].utime_us += 1000;
  recording.samples[1].sequence += 1;
  auto log = EventLogWriter::create(file.path()).value();
  ASSERT_TRUE(write_recording(log, recording));
  ASSERT_TRUE(log.close());

  auto link = LcmLink::open("file://" + file.path() + "?speed=0");
  ASSERT_TRUE(link) << describe(link.error());
  std::vector<std::string> heard;
  ASSERT_TRUE(link->subscribe(".*", [&](const Received& message) {
    if (const auto sample = decode_telemetry(message.data)) {
      EXPECT_TRUE(test::same_bits(sample->sample, recording.samples.at(heard.size() - 1)));
    } else {
      EXPECT_TRUE(decode_mission_event(message.data));
    }
    heard.emplace_back(message.channel);
  }));
  Result<int> handled = 0;
  for (int i = 0; i < 100 && handled; ++i) handled = link->poll(100ms);
  ASSERT_FALSE(handled);
  EXPECT_EQ(handled.error().fault, Fault::unavailable);
  EXPECT_EQ(heard, (std::vector<std::string>{"MISSION_EVENT.amr-07", "ROBOT_TELEMETRY.amr-07",
                                             "ROBOT_TELEMETRY.amr-07", "MISSION_EVENT.amr-07"}));
}

TEST(Recording, RefusesWhatNoRobotCouldPublish) {
  const test::TemporaryFile file;
  auto log = EventLogWriter::create(file.path()).value();
  EXPECT_FALSE(write_recording(log, {"amr-07", "m-1", 0, {}}));
  EXPECT_FALSE(write_recording(log, {"amr 07", "m-1", 0, {signals::Sample{}}}));
  EXPECT_FALSE(write_recording(log, {"amr-07", "m/1", 0, {signals::Sample{}}}));
  EXPECT_EQ(log.count(), 0);
}

TEST(EscapeRegex, MatchesItselfAndNothingElse) {
  const std::string id = "r.2-d+2(x)[y]{z}^$|\\*?";
  const std::regex pattern(escape_regex(id));
  EXPECT_TRUE(std::regex_match(id, pattern));
  EXPECT_FALSE(std::regex_match("rx2-d+2(x)[y]{z}^$|\\*?", pattern));
}

}  // namespace
}  // namespace joulecast::telemetry
