#include "telemetry/lcm_link.h"

#include <gtest/gtest.h>

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

constexpr char link_channel[] = "ROBOT_TELEMETRY.a";
DatagramCounters counters;

TEST(LcmLink, DeliversRobotChannelsOnly) {
  LcmLink link = memory_link();
  std::vector<std::pair<std::string, Bytes>> heard;
  const auto handler = [&](const Received& message) {
    heard.emplace_back(std::string(message.channel), Bytes(message.data.begin(), message.data.end()));
    EXPECT_GT(message.recv_utime_us, 1'600'000'000'000'000);
    EXPECT_FALSE(message.sender.known());
  };
  ASSERT_TRUE(link.listen(handler, counters));
  EXPECT_EQ(link.listen(handler, counters).error().fault, Fault::conflict);
  for (const char* other :
       {"XROBOT_TELEMETRY.a", "ROBOT_TELEMETRY_a", "ROBOT_TELEMETRYxa", "ENERGY_STATE.a", "POSE"})
    ASSERT_TRUE(link.publish(other, Bytes{3}));
  for (const char* ours : {"ROBOT_TELEMETRY.a", "MISSION_EVENT.b-1", "ROBOT_COVARIATES.c"})
    ASSERT_TRUE(link.publish(ours, Bytes{1, 2}));
  while (link.poll(0ms).value() > 0) {
  }
  ASSERT_EQ(heard.size(), 3u);
  EXPECT_EQ(heard[1].first, "MISSION_EVENT.b-1");
  EXPECT_EQ(heard[1].second, (Bytes{1, 2}));
}

TEST(LcmLink, PollHandlesBoundedBatch) {
  LcmLink link = memory_link();
  int heard = 0;
  ASSERT_TRUE(link.listen([&](const Received&) { ++heard; }, counters));
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(link.publish(link_channel, Bytes{1}));
  EXPECT_EQ(link.poll(100ms, 7).value(), 7);
  EXPECT_EQ(link.poll(100ms).value(), 3);
  EXPECT_EQ(heard, 10);
}

TEST(LcmLink, PollTimesOut) {
  LcmLink link = memory_link();
  EXPECT_EQ(link.poll(1ms).value(), 0);
}

TEST(LcmLink, WakeEndsWaitingPoll) {
  LcmLink link = memory_link();
  const auto begin = std::chrono::steady_clock::now();
  std::thread waker([&] {
    std::this_thread::sleep_for(20ms);
    link.wake();
  });
  EXPECT_EQ(link.poll(60s).value(), 0);
  waker.join();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 30s);
  EXPECT_EQ(link.poll(1ms).value(), 0);  // the wake-up is consumed
}

TEST(LcmLink, SurvivesHandlerExceptions) {
  LcmLink link = memory_link();
  int heard = 0;
  const auto handler = [&](const Received&) {
    if (++heard == 1) throw std::runtime_error("handler");
  };
  ASSERT_TRUE(link.listen(handler, counters));
  ASSERT_TRUE(link.publish(link_channel, Bytes{1}));
  ASSERT_TRUE(link.publish(link_channel, Bytes{2}));
  EXPECT_THROW((void)link.poll(100ms), std::runtime_error);
  EXPECT_EQ(link.poll(100ms).value(), 1);
  EXPECT_EQ(heard, 2);
}

TEST(LcmLink, MovesWithItsHandler) {
  LcmLink first = memory_link();
  int heard = 0;
  ASSERT_TRUE(first.listen([&](const Received&) { ++heard; }, counters));
  LcmLink second = std::move(first);
  ASSERT_TRUE(second.publish(link_channel, Bytes{1}));
  EXPECT_EQ(second.poll(100ms).value(), 1);
  EXPECT_EQ(heard, 1);
}

// liblcm is used for providers other than UDP only: its receiver of fragments is unsafe.
TEST(LcmLink, RejectsUnknownProviders) {
  for (const char* bad : {"nonsense://", "mpudpm://", "", "udpm:/", "udpm://239.255.76.67:7667?ttl=x"}) {
    const auto link = LcmLink::open(bad);
    ASSERT_FALSE(link) << bad;
    EXPECT_EQ(link.error().field, "lcm.url");
  }
}

// Over the loopback interface, if multicast is routed to it.
TEST(LcmLink, ReceivesDatagramsWithSender) {
  auto link = LcmLink::open("udpm://239.255.76.67:7799?ttl=0");
  DatagramCounters counted;
  std::vector<Received> heard;
  Bytes data;
  if (!link) GTEST_SKIP() << describe(link.error());
  const auto listening = link->listen(
      [&](const Received& message) {
        heard.push_back(message);
        data.assign(message.data.begin(), message.data.end());
      },
      counted, {"", "any"});
  if (!listening) GTEST_SKIP() << describe(listening.error());
  const Bytes large(60'000, 7);
  ASSERT_TRUE(link->publish(link_channel, large));
  if (link->poll(1000ms).value() == 0) GTEST_SKIP() << "no multicast here";
  ASSERT_EQ(heard.size(), 1u);
  EXPECT_TRUE(heard[0].sender.known());
  EXPECT_EQ(data, large);
  const Bytes fragmented(65'520, 8);  // more than liblcm sends in one datagram
  ASSERT_TRUE(link->publish(link_channel, fragmented));
  while (heard.size() < 2 && link->poll(1000ms).value() > 0) {
  }
  EXPECT_EQ(data, fragmented);
  EXPECT_EQ(counted.received, 3u);
  EXPECT_FALSE(LcmLink::open("udpm://239.255.76.67:7799?ttl=0")
                   ->listen([](const Received&) {}, counted, {"203.0.113.9", "any"}));
}

// The longest robot id fits the channel names of LCM's strictest provider.
TEST(LcmLink, AcceptsLongestRobotId) {
  EXPECT_EQ(channel_of(Subject::telemetry, std::string(signals::max_robot_id_length, 'r')).size(), 63u);
}

TEST(LcmLink, ReplaysLogToItsEnd) {
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
  const auto handler = [&](const Received& message) {
    if (const auto sample = decode_telemetry(message.data)) {
      EXPECT_TRUE(test::same_bits(sample->sample, recording.samples.at(heard.size() - 1)));
    } else {
      EXPECT_TRUE(decode_mission_event(message.data));
    }
    heard.emplace_back(message.channel);
  };
  ASSERT_TRUE(link->listen(handler, counters));
  Result<int> handled = 0;
  for (int i = 0; i < 100 && handled; ++i) handled = link->poll(100ms);
  ASSERT_FALSE(handled);
  EXPECT_EQ(handled.error().fault, Fault::unavailable);
  EXPECT_EQ(heard, (std::vector<std::string>{"MISSION_EVENT.amr-07", "ROBOT_TELEMETRY.amr-07",
                                             "ROBOT_TELEMETRY.amr-07", "MISSION_EVENT.amr-07"}));
}

TEST(Recording, RejectsUnpublishableMessages) {
  const test::TemporaryFile file;
  auto log = EventLogWriter::create(file.path()).value();
  EXPECT_FALSE(write_recording(log, {"amr-07", "m-1", 0, {}}));
  EXPECT_FALSE(write_recording(log, {"amr 07", "m-1", 0, {signals::Sample{}}}));
  EXPECT_FALSE(write_recording(log, {"amr-07", "m/1", 0, {signals::Sample{}}}));
  EXPECT_EQ(log.count(), 0);
}

}  // namespace
}  // namespace joulecast::telemetry
