#include "ingest/open_mission.h"

#include <gtest/gtest.h>

namespace joulecast::ingest {
namespace {

constexpr std::int64_t open_start_us = 1'700'000'000'000'000, open_second_us = 1'000'000;

OpenMission begun() {
  telemetry::MissionAction action;
  action.mission_id = "tour";
  action.utime_us = open_start_us;
  action.note = "morning";
  return {"amr", action, 3, {}};
}

telemetry::MissionAction ended(telemetry::MissionEnd end) {
  telemetry::MissionAction action;
  action.kind = telemetry::MissionAction::Kind::close;
  action.utime_us = open_start_us + 60 * open_second_us;
  action.end = end;
  return action;
}

TEST(OpenMission, EndsAfterItsBegin) {
  OpenMission mission = begun();
  mission.end_at(open_start_us - open_second_us);
  EXPECT_EQ(mission.record.end_utime_us, open_start_us);
}

TEST(OpenMission, ReportsWhyItIsIncomplete) {
  OpenMission silent = begun();
  silent.finish(ended(telemetry::MissionEnd::unfinished));
  EXPECT_EQ(silent.record.state, history::MissionState::unfinished);
  EXPECT_EQ(silent.record.incomplete_reason, "the robot fell silent before the end");

  OpenMission resumed(begun().record);
  resumed.finish(ended(telemetry::MissionEnd::finished));
  EXPECT_EQ(resumed.record.state, history::MissionState::interrupted);

  OpenMission went_on(begun().record);
  went_on.go_on_after_silence(open_start_us + 30 * open_second_us);
  went_on.finish(ended(telemetry::MissionEnd::finished));
  EXPECT_EQ(went_on.record.state, history::MissionState::finished);
  EXPECT_EQ(went_on.record.incomplete_reason, "the service was down during the mission");
}

TEST(OpenMission, KeepsBothNotes) {
  OpenMission mission = begun();
  telemetry::MissionAction action = ended(telemetry::MissionEnd::finished);
  action.note = "morning";
  mission.finish(action);
  EXPECT_EQ(mission.record.note, "morning");
  action.note = "pallet lost";
  mission.finish(action);
  EXPECT_EQ(mission.record.note, "morning; pallet lost");
}

TEST(OpenMission, ClockStepLimitsBookedTime) {
  OpenMission mission = begun();
  mission.keep({});
  EXPECT_FALSE(mission.book(3600 * open_second_us, open_start_us, 0)) << "as long as the clock runs on";
  mission.on_clock_step(open_start_us);
  EXPECT_FALSE(mission.book(10 * open_second_us, open_start_us + open_second_us, 20 * open_second_us));
  const auto too_fast =
      mission.book(12 * open_second_us, open_start_us + open_second_us, 20 * open_second_us);
  ASSERT_TRUE(too_fast);
  EXPECT_EQ(too_fast->booked_us, 22 * open_second_us);
  EXPECT_EQ(too_fast->passed_us, open_second_us);
  EXPECT_FALSE(mission.book(10 * open_second_us, open_start_us + open_second_us, 20 * open_second_us))
      << "rejected time is not booked";
}

}  // namespace
}  // namespace joulecast::ingest
