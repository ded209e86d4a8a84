#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "telemetry/codec.h"
#include "telemetry/event_log.h"
#include "telemetry/mission_tracker.h"
#include "telemetry/sequence_tracker.h"
#include "telemetry/validation.h"
#include "tests/support/shared_folder.h"

namespace joulecast::telemetry {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> practice_logs() {
  std::vector<fs::path> logs;
  std::error_code none;
  for (const auto& folder : fs::directory_iterator(JOULECAST_SHARED "/data/practice", none)) {
    if (fs::exists(folder.path() / "telemetry.lcmlog")) logs.push_back(folder.path() / "telemetry.lcmlog");
  }
  return logs;
}

// "missions": 5 of the recording's truth file.
std::size_t true_missions(const fs::path& log) {
  std::ifstream file(log.parent_path() / "truth.json");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  return std::stoul(text.substr(text.find("\"missions\":") + 11));
}

// Whole recordings of another implementation of the contract pass the guard, re-encode to their very bytes,
// and split into the missions that were driven. Equal bytes mean equal fingerprints.
TEST(PracticeLogs, DecodeExactlyAndSplitIntoTheirMissions) {
  const auto logs = practice_logs();
  JOULECAST_NEED_SHARED(!logs.empty(), "practice recordings");
  for (const fs::path& path : logs) {
    SCOPED_TRACE(path.parent_path().filename().string());
    EventLogReader reader = EventLogReader::open(path.string()).value();
    SequenceTracker sequence;
    MissionTracker missions;
    std::size_t finished = 0;
    std::uint64_t samples = 0;
    LogRead read = reader.next();
    for (; read.status == LogStatus::event; read = reader.next()) {
      const auto channel = parse_channel(read.event.channel);
      ASSERT_TRUE(channel);
      const std::vector<std::uint8_t> bytes(read.event.data.begin(), read.event.data.end());
      if (channel->subject == Subject::mission_event) {
        const auto event = decode_mission_event(bytes);
        ASSERT_TRUE(event) << describe(event.error());
        ASSERT_EQ(event->robot_id, channel->robot_id);
        ASSERT_EQ(encode_mission_event(event->robot_id, event->event).value(), bytes);
        for (const MissionAction& action : missions.on_event(event->event)) {
          if (action.kind == MissionAction::Kind::close && !action.implicit) {
            ASSERT_EQ(action.end, MissionEnd::finished);
            ++finished;
          }
        }
        continue;
      }
      const auto sample = decode_telemetry(bytes);
      ASSERT_TRUE(sample) << describe(sample.error());
      ASSERT_EQ(sample->robot_id, channel->robot_id);
      ASSERT_EQ(encode_telemetry(sample->robot_id, sample->sample).value(), bytes);
      const auto fault = check_plausible(sample->sample);
      ASSERT_FALSE(fault) << describe(*fault);
      const Placement placement = sequence.place(sample->sample.sequence, sample->sample.utime_us);
      if (placement.advances()) missions.on_sample(sample->sample.utime_us, sample->sample.payload_kg);
      ++samples;
    }
    EXPECT_EQ(read.status, LogStatus::end) << read.message;
    EXPECT_EQ(finished, true_missions(path));
    EXPECT_EQ(sequence.counters().received, samples);
    EXPECT_EQ(sequence.counters().fresh, samples);
    EXPECT_EQ(missions.counters().unknown_missions, 0u);
  }
}

}  // namespace
}  // namespace joulecast::telemetry
