// Missions that a scheduler begins and ends over HTTP, with the robot's own events and over restarts.

#include <gtest/gtest.h>

#include "ingest/inbound_message.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::ingest {
namespace {

using signals::MissionEvent;
using signals::MissionPhase;

constexpr std::int64_t requests_start_us = 1'750'000'000'000'000;

class MissionRequestsTest : public ::testing::Test {
 protected:
  MissionRequestsTest() { harness_.add_robot(testing::nomad()); }

  void drive(int samples) {
    for (int k = 0; k < samples; ++k) {
      signals::Sample s;
      s.utime_us = now_us();
      s.sequence = sequence_++;
      s.wheel_velocity_rad_s = {3, 3};
      s.battery_voltage_v = 24;
      s.battery_current_a = 2;
      harness_.pipeline->handle({"nomad", s, s.utime_us});
    }
    harness_.pipeline->publish();
  }

  std::int64_t now_us() const { return requests_start_us + sequence_ * 20'000; }

  MissionRequest request(MissionPhase phase, const std::string& id) {
    const std::int64_t before_us = stored_.empty() ? 0 : stored_.back().request_utime_us;
    const MissionRequest made{{now_us(), id, phase, 3, "by test"}, std::max(now_us(), before_us + 1)};
    stored_.push_back(made);
    const history::Command put = history::PutLearned{
        {"nomad", std::string(mission_request_topic), made.request_utime_us, mission_requests_json(stored_)}};
    EXPECT_TRUE(harness_.store->apply({&put, 1})->front());
    return made;
  }

  void pass(const MissionRequest& request) {
    harness_.pipeline->handle({"nomad", request, request.request_utime_us});
    harness_.pipeline->publish();
  }

  void announce(MissionPhase phase, const std::string& id) {
    harness_.pipeline->handle({"nomad", MissionEvent{now_us(), id, phase, 3, ""}, now_us()});
    harness_.pipeline->publish();
  }

  std::string open() const { return harness_.fleet.find("nomad")->mission_id; }

  testing::PipelineHarness harness_;
  std::vector<MissionRequest> stored_;
  std::int64_t sequence_ = 0;
};

TEST_F(MissionRequestsTest, BeginsAndEndsMission) {
  drive(100);
  const MissionRequest begin = request(MissionPhase::started, "order");
  pass(begin);
  EXPECT_EQ(open(), "order");
  EXPECT_EQ(harness_.fleet.find("nomad")->mission_request_utime_us, begin.request_utime_us);
  drive(200);
  pass(begin);  // again: ignored
  const MissionRequest end = request(MissionPhase::finished, "order");
  pass(end);
  drive(100);
  const auto missions = harness_.missions();
  ASSERT_EQ(missions.size(), 3u);  // implicit ones before and after
  EXPECT_EQ(missions[1].mission_id, "order");
  EXPECT_EQ(missions[1].state, history::MissionState::finished);
  EXPECT_EQ(missions[1].start_utime_us, begin.event.utime_us);
  EXPECT_EQ(missions[1].end_utime_us, end.event.utime_us);
  EXPECT_EQ(missions[1].samples, 200);
  EXPECT_DOUBLE_EQ(missions[1].payload_kg, 3);
  EXPECT_TRUE(missions[0].implicit && missions[2].implicit);
  EXPECT_EQ(harness_.faults(IngestFault::bad_event), 0u);
}

TEST_F(MissionRequestsTest, CarriesOutStoredRequestsAfterRestart) {
  drive(100);
  (void)request(MissionPhase::started, "order");  // stored; the daemon ends before it acts on it
  harness_.restart();
  drive(0);
  EXPECT_EQ(open(), "order");
  drive(200);
  harness_.pipeline->tick(now_us());
  (void)request(MissionPhase::aborted, "order");
  harness_.restart();
  const auto missions = harness_.missions();
  ASSERT_GE(missions.size(), 2u);
  EXPECT_EQ(missions.back().mission_id, "order");
  EXPECT_EQ(missions.back().state, history::MissionState::aborted);
  EXPECT_EQ(missions.back().samples, 200);
  EXPECT_EQ(harness_.faults(IngestFault::bad_event), 0u);
  harness_.restart();  // the effects of both are stored
  drive(0);
  EXPECT_EQ(open(), "");
  EXPECT_EQ(harness_.missions().size(), missions.size());
  EXPECT_EQ(harness_.faults(IngestFault::empty_mission), 0u);
}

TEST_F(MissionRequestsTest, RefusesRobotsContradictingEvents) {
  drive(10);
  pass(request(MissionPhase::started, "order"));
  drive(400);
  announce(MissionPhase::started, "patrol");
  EXPECT_EQ(open(), "order");
  announce(MissionPhase::finished, "patrol");
  EXPECT_EQ(open(), "order");
  EXPECT_EQ(harness_.faults(IngestFault::bad_event), 2u);
  EXPECT_NE(harness_.fleet.find("nomad")->fault_notes.at("bad_event").find("requested over HTTP"),
            std::string::npos);
  harness_.pipeline->tick(now_us());
  harness_.restart();  // who began the mission is known after a restart too
  drive(10);
  announce(MissionPhase::started, "patrol");
  EXPECT_EQ(open(), "order");
  pass(request(MissionPhase::finished, "order"));
  announce(MissionPhase::started, "patrol");
  EXPECT_EQ(open(), "patrol");
}

TEST_F(MissionRequestsTest, RefusesContradictingRequests) {
  drive(10);
  announce(MissionPhase::started, "patrol");
  drive(400);
  pass(request(MissionPhase::started, "order"));
  EXPECT_EQ(open(), "patrol");
  pass(request(MissionPhase::finished, "order"));
  EXPECT_EQ(open(), "patrol");
  EXPECT_EQ(harness_.faults(IngestFault::bad_event), 2u);
  pass(request(MissionPhase::aborted, "patrol"));  // both name it
  EXPECT_EQ(open(), "");
}

TEST_F(MissionRequestsTest, SilenceCountsFromRequest) {
  drive(10);
  sequence_ += 3600 * 50;  // an hour
  pass(request(MissionPhase::started, "order"));
  harness_.pipeline->tick(now_us() + 1'000'000);
  harness_.pipeline->publish();
  EXPECT_EQ(open(), "order");
  harness_.pipeline->tick(now_us() + 700'000'000);
  harness_.pipeline->publish();
  EXPECT_EQ(open(), "");
}

}  // namespace
}  // namespace joulecast::ingest
