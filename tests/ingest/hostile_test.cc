// Bad publishers, by mistake or by intent, must not change an honest robot's history.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "ingest/pipeline.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::ingest {
namespace {

using signals::MissionEvent;
using signals::MissionPhase;
using signals::Sample;
using telemetry::Sender;
using testing::PipelineHarness;

constexpr std::int64_t hostile_start_us = 1'750'000'000'000'000, hostile_second_us = 1'000'000,
                       hostile_period_us = 20'000;
constexpr Sender honest_sender{0x0a000005, 40'000}, twin{0x0a000006, 41'000};

Sample hostile_sample(std::int64_t sequence, std::int64_t utime_us, double power_w = 48) {
  Sample s;
  s.utime_us = utime_us;
  s.sequence = sequence;
  s.wheel_velocity_rad_s = {3, 3};
  s.battery_voltage_v = 24;
  s.battery_current_a = power_w / 24;
  s.payload_kg = 2;
  return s;
}

class HostileTest : public ::testing::Test {
 protected:
  void SetUp() override { harness.add_robot(testing::nomad()); }

  template <class Content>
  void send(Content content, std::int64_t host_us, const Sender& sender = honest_sender,
            const std::string& id = "nomad") {
    harness.pipeline->handle({id, std::move(content), host_us, sender});
  }
  // Number k of a robot that samples at 50 Hz, sent as it is sampled.
  void send_own(std::int64_t k, const Sender& sender = honest_sender) {
    send(hostile_sample(k, hostile_start_us + k * hostile_period_us),
         hostile_start_us + k * hostile_period_us, sender);
  }
  void announce(MissionPhase phase, std::int64_t k, const std::string& id = "m1",
                const Sender& sender = honest_sender) {
    const std::int64_t at_us = hostile_start_us + k * hostile_period_us;
    send(MissionEvent{at_us, id, phase, 2, ""}, at_us, sender);
  }
  std::string note(const std::string& reason) {
    harness.pipeline->publish();
    const auto snapshot = harness.fleet.find("nomad");
    const auto found = snapshot->fault_notes.find(reason);
    return found == snapshot->fault_notes.end() ? "" : found->second;
  }
  history::Mission only_mission() {
    const auto missions = harness.missions();
    EXPECT_EQ(missions.size(), 1u);
    return missions.at(0);
  }

  PipelineHarness harness;
};

void expect_own_only(const history::Mission& mission, std::int64_t samples) {
  EXPECT_EQ(mission.state, history::MissionState::finished);
  EXPECT_EQ(mission.mission_id, "m1");
  EXPECT_FALSE(mission.incomplete);
  EXPECT_EQ(mission.samples, samples);
  EXPECT_NEAR(mission.accounts.measured_j, 48 * 0.02 * static_cast<double>(samples - 1), 1e-6);
}

TEST_F(HostileTest, NamesTheRejectedSender) {
  announce(MissionPhase::started, 0);
  for (std::int64_t k = 0; k < 500; ++k) {
    send_own(k);
    const std::int64_t host_us = hostile_start_us + k * hostile_period_us + 3'000;
    if (k == 200) send(MissionEvent{host_us, "theirs", MissionPhase::started, 0, ""}, host_us, twin);
    if (k >= 200) send(hostile_sample(k + 7000, host_us + 1'000'000, 500), host_us, twin);
    if (k == 400) send(signals::CovariateMessage{host_us, {{"load", 1}}}, host_us, twin);
  }
  announce(MissionPhase::finished, 500);
  expect_own_only(only_mission(), 500);
  EXPECT_GE(harness.faults(IngestFault::second_sender), 300u);
  EXPECT_EQ(note("second_sender"),
            "10.0.0.6:41000 publishes under this robot's id in addition to 10.0.0.5:40000, which alone is "
            "accounted for");
  // Once, not 300 times, and once as a contradiction.
  ASSERT_EQ(harness.warnings.size(), 2u);
}

TEST_F(HostileTest, SeparatesStreamsOfOneSender) {
  announce(MissionPhase::started, 0);
  for (std::int64_t k = 0; k < 500; ++k) {
    send_own(k);
    if (k >= 100)
      send(hostile_sample(k + 90'000, hostile_start_us + k * hostile_period_us + 103'000, 500),
           hostile_start_us + k * hostile_period_us + 3'000);
  }
  announce(MissionPhase::finished, 500);
  const auto mission = only_mission();
  EXPECT_GE(harness.faults(IngestFault::second_sender), 390u);
  EXPECT_NE(note("second_sender").find("two streams"), std::string::npos);
  // Except samples from before the second stream was detected.
  EXPECT_NEAR(static_cast<double>(mission.samples), 500, 10);
  EXPECT_LE(mission.accounts.duration_s, 10.0);
  EXPECT_NEAR(mission.accounts.measured_j, 480, 50);  // 0.1 s of the other
}

TEST_F(HostileTest, RestartedPublisherLosesNothing) {
  announce(MissionPhase::started, 0);
  for (std::int64_t k = 0; k < 250; ++k) send_own(k);
  const Sender again{honest_sender.address, 40'001}, moved{0x0a000009, 7};
  for (std::int64_t k = 255; k < 500; ++k)
    send(hostile_sample(k - 255, hostile_start_us + k * hostile_period_us),
         hostile_start_us + k * hostile_period_us, again);
  for (std::int64_t k = 500; k < 750; ++k)
    send(hostile_sample(k - 255, hostile_start_us + k * hostile_period_us),
         hostile_start_us + k * hostile_period_us, moved);
  announce(MissionPhase::finished, 750, "m1", moved);
  harness.pipeline->tick(hostile_start_us + 760 * hostile_period_us);
  const auto mission = only_mission();
  EXPECT_EQ(mission.samples, 745);
  EXPECT_NEAR(mission.accounts.measured_j, 48 * 0.02 * 749, 1e-6);
  EXPECT_EQ(mission.state, history::MissionState::finished);
  EXPECT_EQ(harness.faults(IngestFault::second_sender), 0u);
}

TEST_F(HostileTest, AcceptsSuccessivePublishers) {
  announce(MissionPhase::started, 0);
  for (std::int64_t k = 0; k < 100; ++k) send_own(k);
  announce(MissionPhase::finished, 100);
  announce(MissionPhase::started, 105, "m2", twin);
  for (std::int64_t k = 105; k < 115; ++k) send_own(k, twin);
  announce(MissionPhase::finished, 115, "m2", twin);
  harness.pipeline->suspend();
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 2u);
  EXPECT_EQ(missions[1].mission_id, "m2");
  EXPECT_EQ(missions[1].samples, 10);
  EXPECT_EQ(harness.faults(IngestFault::second_sender), 0u);
}

TEST_F(HostileTest, FleetManagerMayAnnounceMissions) {
  announce(MissionPhase::started, 0, "m1", twin);
  for (std::int64_t k = 0; k < 100; ++k) send_own(k);
  announce(MissionPhase::finished, 100, "m1", twin);
  expect_own_only(only_mission(), 100);
}

TEST_F(HostileTest, ChangingPortsAreOneSender) {
  announce(MissionPhase::started, 0);
  for (std::int64_t k = 0; k < 300; ++k)
    send_own(k, {honest_sender.address, static_cast<std::uint16_t>(30'000 + k)});
  announce(MissionPhase::finished, 300, "m1", {honest_sender.address, 5});
  harness.pipeline->suspend();
  expect_own_only(only_mission(), 300);
}

TEST_F(HostileTest, WaitingMessagesAreBounded) {
  for (std::int64_t k = 0; k < 10; ++k) send_own(k);
  for (std::int64_t k = 0; k < 30'000; ++k)
    send(hostile_sample(k, hostile_start_us + k), hostile_start_us + 10 * hostile_period_us, twin);
  EXPECT_EQ(harness.faults(IngestFault::second_sender), 30'000u - 16'384u);
  send_own(10);
  EXPECT_EQ(harness.faults(IngestFault::second_sender), 30'000u);
}

TEST_F(HostileTest, ShuffledSamplesAreSortedIn) {
  std::mt19937 random(3);
  announce(MissionPhase::started, 0);
  send_own(0);
  for (std::int64_t window = 0; window < 100; ++window) {
    std::vector<std::int64_t> numbers;
    for (std::int64_t k = 0; k < 12; ++k) numbers.push_back(1 + window * 12 + k);
    std::ranges::shuffle(numbers, random);
    std::int64_t host_us = hostile_start_us + (1 + window * 12) * hostile_period_us;
    for (const std::int64_t k : numbers) {
      send(hostile_sample(k, hostile_start_us + k * hostile_period_us), host_us += hostile_period_us);
      if (k % 5 == 0) send(hostile_sample(k, hostile_start_us + k * hostile_period_us), host_us);  // twice
    }
  }
  announce(MissionPhase::finished, 1220);
  expect_own_only(only_mission(), 1201);
  EXPECT_EQ(harness.faults(IngestFault::duplicate), 240u);
  EXPECT_EQ(harness.faults(IngestFault::missing), 0u);
}

TEST_F(HostileTest, HolesDelayBriefly) {
  announce(MissionPhase::started, 0);
  for (std::int64_t k = 0; k < 100; ++k) send_own(k);
  for (std::int64_t k = 101; k < 130; ++k) send_own(k);
  harness.pipeline->publish();
  // 0.5 s after the first behind the hole.
  EXPECT_GE(harness.fleet.find("nomad")->samples, 127u);
  send_own(100);
  EXPECT_EQ(harness.faults(IngestFault::late), 1u);
  for (std::int64_t k = 131; k < 135; ++k) send_own(k);
  harness.pipeline->tick(hostile_start_us + 200 * hostile_period_us);
  EXPECT_EQ(harness.fleet.find("nomad")->samples, 133u);
}

TEST_F(HostileTest, RepeatedClockStepsBookRealTime) {
  announce(MissionPhase::started, 0);
  std::int64_t sequence = 0;
  for (int round = 0; round < 200; ++round) {
    // 60 s of the robot's clock in 1 s of the host's, then back again.
    for (std::int64_t k = 0; k < 60; ++k)
      send(hostile_sample(sequence++, hostile_start_us + k * hostile_second_us),
           hostile_start_us + round * hostile_second_us + k * 16'000);
  }
  harness.pipeline->suspend();
  const auto mission = only_mission();
  EXPECT_LE(mission.accounts.duration_s, 60 + 200 + 60 + 1);
  EXPECT_GE(mission.accounts.duration_s, 200);
  EXPECT_GT(harness.faults(IngestFault::too_fast), 5000u);
  EXPECT_GE(mission.end_utime_us, mission.start_utime_us);
  EXPECT_TRUE(mission.incomplete);
  EXPECT_FALSE(note("too_fast").empty());
}

TEST_F(HostileTest, AcceptsFastReplays) {
  announce(MissionPhase::started, 0);
  for (std::int64_t k = 0; k < 20'000; ++k)
    send(hostile_sample(k, hostile_start_us + k * hostile_period_us), hostile_start_us + k);
  send(MissionEvent{hostile_start_us + 20'000 * hostile_period_us, "m1", MissionPhase::finished, 2, ""},
       hostile_start_us + 20'000);
  expect_own_only(only_mission(), 20'000);
}

TEST_F(HostileTest, MissionsEndAfterTheirStart) {
  announce(MissionPhase::started, 0);
  for (std::int64_t k = 0; k < 50; ++k) send_own(k);
  for (std::int64_t k = 50; k < 100; ++k)
    send(hostile_sample(k, hostile_start_us + (k - 500'000) * hostile_period_us),
         hostile_start_us + k * hostile_period_us);
  announce(MissionPhase::finished, 100);
  const auto mission = only_mission();
  EXPECT_GE(mission.end_utime_us, mission.start_utime_us);
  EXPECT_NEAR(mission.accounts.measured_j, 48 * 0.02 * 98, 1e-6);
}

TEST(HostileClocks, RejectsTimesTooFarAhead) {
  SessionSettings settings;
  settings.max_ahead_us = 300 * hostile_second_us;
  PipelineHarness harness(settings);
  harness.add_robot(testing::nomad());
  const auto send = [&](auto content, std::int64_t host_us) {
    harness.pipeline->handle({"nomad", std::move(content), host_us});
  };
  send(MissionEvent{7'000'000'000'000'000, "2191", MissionPhase::started, 2, ""}, hostile_start_us);
  send(signals::CovariateMessage{7'000'000'000'000'000, {{"load", 1}}}, hostile_start_us);
  send(MissionEvent{hostile_start_us, "m1", MissionPhase::started, 2, ""}, hostile_start_us);
  for (std::int64_t k = 0; k < 300; ++k) {
    const std::int64_t host_us = hostile_start_us + k * hostile_period_us;
    send(hostile_sample(k, host_us + (k == 7 ? 300 * hostile_second_us + 1 : 0)), host_us);
  }
  send(MissionEvent{hostile_start_us + 6 * hostile_second_us, "m1", MissionPhase::finished, 2, ""},
       hostile_start_us + 6 * hostile_second_us);
  EXPECT_EQ(harness.faults(IngestFault::too_far_ahead), 3u);
  const auto missions = harness.missions();
  harness.pipeline->publish();
  ASSERT_EQ(missions.size(), 1u);
  EXPECT_EQ(missions[0].samples, 299);
  EXPECT_NEAR(missions[0].accounts.measured_j, 48 * 0.02 * 299, 1e-6);
  EXPECT_EQ(harness.fleet.find("nomad")->fault_notes.at("too_far_ahead"),
            "utime is 300 s ahead of the service's clock; at most 300 s are accepted");
}

TEST_F(HostileTest, RejectsEventFloods) {
  for (std::int64_t k = 0; k < 10'000; ++k) {
    const std::int64_t at_us = hostile_start_us + k * 1000;
    send(MissionEvent{at_us, "f" + std::to_string(k), MissionPhase::started, 0, ""}, at_us);
  }
  EXPECT_EQ(harness.faults(IngestFault::event_flood), 10'000u - 100 - 49);
  EXPECT_EQ(harness.faults(IngestFault::empty_mission), 148u);
  EXPECT_TRUE(harness.missions().empty());
  EXPECT_TRUE(harness.store->events(0, 100)->empty());
  announce(MissionPhase::started, 2000);
  for (std::int64_t k = 2000; k < 2100; ++k) send_own(k);
  announce(MissionPhase::finished, 2100);
  expect_own_only(only_mission(), 100);
  EXPECT_LE(harness.warnings.size(), 2u);
}

TEST_F(HostileTest, RepeatedEventsAreNoFlood) {
  std::int64_t sequence = 0;
  for (int mission = 0; mission < 500; ++mission) {
    const std::string id = "m" + std::to_string(mission);
    const auto say = [&](MissionPhase phase) {
      for (int k = 0; k < 10; ++k)
        send(MissionEvent{hostile_start_us + sequence * hostile_period_us, id, phase, 2, ""},
             hostile_start_us);
    };
    say(MissionPhase::started);
    for (int k = 0; k < 20; ++k, ++sequence)
      send(hostile_sample(sequence, hostile_start_us + sequence * hostile_period_us), hostile_start_us);
    say(MissionPhase::finished);
  }
  EXPECT_EQ(harness.faults(IngestFault::event_flood), 0u);
  EXPECT_EQ(harness.missions().size(), 500u);
}

TEST_F(HostileTest, InventedIdsExcludeNoRobot) {
  for (std::int64_t k = 0; k < 100'000; ++k)
    send(hostile_sample(0, hostile_start_us), hostile_start_us + k, twin, "junk-" + std::to_string(k));
  harness.pipeline->publish();
  EXPECT_EQ(harness.fleet.all().size(), 100u);
  EXPECT_EQ(harness.faults(IngestFault::unknown_robot), 100'000u);
  EXPECT_EQ(harness.faults(IngestFault::too_many_robots), 99'900u);
  EXPECT_EQ(harness.warnings.size(), 1u);
  robot::RobotModel late = testing::nomad();
  late.robot_id = "junk-5";  // one of those that are remembered
  harness.add_robot(late);
  late.robot_id = "real";
  harness.add_robot(late);
  for (const char* id : {"junk-5", "real"}) {
    for (std::int64_t k = 0; k < 100; ++k)
      send(hostile_sample(k, hostile_start_us + k * hostile_period_us),
           hostile_start_us + k * hostile_period_us, honest_sender, id);
  }
  harness.pipeline->publish();
  for (const char* id : {"junk-5", "real"}) {
    EXPECT_TRUE(harness.fleet.find(id)->has_model);
    EXPECT_EQ(harness.fleet.find(id)->samples, 100u);
  }
}

TEST_F(HostileTest, SilentUnknownIdsAreReplaced) {
  for (std::int64_t k = 0; k < 100; ++k)
    send(hostile_sample(0, hostile_start_us), hostile_start_us, twin, "junk-" + std::to_string(k));
  send(hostile_sample(0, hostile_start_us), hostile_start_us + 61 * hostile_second_us, twin, "newcomer");
  harness.pipeline->publish();
  EXPECT_NE(harness.fleet.find("newcomer"), nullptr);
  EXPECT_LE(harness.fleet.all().size(), 100u);
}

TEST_F(HostileTest, CountsRejectedMessagesPerChannel) {
  send_own(0);
  const auto bytes = telemetry::encode_telemetry("impostor", hostile_sample(1, hostile_start_us)).value();
  const auto wrong = decode_message("ROBOT_TELEMETRY.nomad", bytes, hostile_start_us, harness.counters);
  ASSERT_TRUE(wrong);
  harness.pipeline->handle(*wrong);
  const auto torn =
      decode_message("ROBOT_TELEMETRY.nomad", std::span(bytes).first(20), hostile_start_us, harness.counters);
  harness.pipeline->handle(*torn);
  EXPECT_EQ(harness.faults(IngestFault::wrong_channel), 1u);
  EXPECT_EQ(harness.faults(IngestFault::undecodable), 1u);
  EXPECT_EQ(note("wrong_channel"), "ROBOT_TELEMETRY.nomad: carries messages of robot_id impostor");
  EXPECT_NE(note("undecodable").find("sequence"), std::string::npos);
  EXPECT_EQ(harness.fleet.find("nomad")->faults.at("wrong_channel"), 1u);
  EXPECT_EQ(harness.fleet.find("impostor"), nullptr);
}

TEST_F(HostileTest, DatesReportsByTheHost) {
  for (std::int64_t k = 0; k < 400; ++k) {
    const std::int64_t now = hostile_start_us + k * 100'000;
    const auto bytes = telemetry::encode_telemetry("impostor", hostile_sample(k, now)).value();
    harness.pipeline->handle(*decode_message("ROBOT_TELEMETRY.nomad", bytes, now, harness.counters));
    harness.pipeline->tick(now);
  }
  const auto events = harness.store->events(0, 100).value();
  ASSERT_FALSE(events.empty());
  for (const history::Event& event : events) EXPECT_GE(event.utime_us, hostile_start_us) << event.detail_json;
}

TEST_F(HostileTest, NamesImplausibleFieldAndBound) {
  for (std::int64_t k = 0; k < 100; ++k) {
    Sample s = hostile_sample(k, hostile_start_us + k * hostile_period_us);
    s.battery_voltage_v = 25'400;
    send(s, s.utime_us);
  }
  EXPECT_EQ(note("implausible"),
            "battery_voltage is 25400; no robot reports values outside -1 to 1000; is it in mV?");
  ASSERT_EQ(harness.warnings.size(), 1u);
  EXPECT_NE(harness.warnings[0].find("battery_voltage"), std::string::npos);
  Sample s = hostile_sample(100, hostile_start_us);
  s.wheel_velocity_rad_s[1] = signals::unmeasured;
  send(s, hostile_start_us + 601 * hostile_second_us);
  EXPECT_EQ(note("implausible"), "wheel_velocity[1] must be measured");
  ASSERT_EQ(harness.warnings.size(), 2u);
  EXPECT_NE(harness.warnings[1].find("100 since"), std::string::npos);
}

}  // namespace
}  // namespace joulecast::ingest
