#include "server/diagnosis/mission_recordings.h"

#include <gtest/gtest.h>

#include "telemetry/event_log.h"
#include "telemetry/log_recordings.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::server {
namespace {

constexpr std::int64_t recordings_start_us = 1'750'000'000'000'000;

telemetry::Recording recording(const std::string& mission, std::int64_t begin_us) {
  telemetry::Recording made{"nomad", mission, 2.5, {}};
  for (int k = 0; k < 3000; ++k) {
    signals::Sample sample;
    sample.utime_us = begin_us + 20'000 * k;
    sample.sequence = begin_us / 20'000 + k;
    sample.wheel_velocity_rad_s = {3, 3};
    sample.payload_kg = 2.5;
    made.samples.push_back(sample);
  }
  made.covariates = {{"floor=ice", {begin_us, begin_us + 30'000'000}, {1, 0}}, {"cpu_load", {}, {}}};
  for (int k = 0; k < 2500; ++k) {  // more than a chunk of them
    made.covariates[1].utime_us.push_back(begin_us + 20'000 * k);
    made.covariates[1].value.push_back(0.1 + 0.001 * k);
  }
  return made;
}

// A log read as a file and the same log after storage have equal covariates.
TEST(MissionRecordings, KeepsCovariatesOfLog) {
  const testing::TemporaryFolder folder;
  const std::string path = folder.file("run.lcmlog");
  auto log = telemetry::EventLogWriter::create(path);
  ASSERT_TRUE(log);
  for (const auto& one :
       {recording("m1", recordings_start_us), recording("m2", recordings_start_us + 60'000'000)})
    ASSERT_TRUE(telemetry::write_recording(*log, one));
  ASSERT_TRUE(log->close());
  const auto read = telemetry::read_recordings({&path, 1});
  ASSERT_TRUE(read) << describe(read.error());
  ASSERT_EQ(read->recordings.size(), 2u);

  testing::PipelineHarness harness;
  harness.add_robot(testing::nomad());
  telemetry::LogTally tally;
  ASSERT_TRUE(telemetry::read_events(
      path,
      [&](const telemetry::LogEvent& event) -> Result<bool> {
        const auto message = decode_message(event.channel, event.data, event.timestamp_us, harness.counters);
        if (message) harness.pipeline->handle(*message);
        return true;
      },
      tally));
  for (const auto& count : harness.counters.faults) EXPECT_EQ(count, 0u);
  RecordingsWanted wanted;
  wanted.robot_id = "nomad";
  const auto stored = read_recordings(*harness.store, wanted);
  ASSERT_TRUE(stored) << describe(stored.error());
  ASSERT_EQ(stored->missions.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    const auto &a = stored->missions[k].recording.covariates, &b = read->recordings[k].covariates;
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i].name, b[i].name);
      EXPECT_EQ(a[i].utime_us, b[i].utime_us);
      EXPECT_EQ(a[i].value, b[i].value);
    }
    EXPECT_EQ(a.size(), 2u);
  }
  // Missions that are excluded from learning are omitted and counted.
  auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 2u);
  missions[0].findings_json = R"({"contradictions":[{"id":"battery_current_reversed"}]})";
  missions[1].findings_json = history::annulled_findings(missions[1], recordings_start_us, "a trial");
  for (const history::Mission& mission : missions) {
    const history::Command command = history::CheckpointMission{mission, {}, {}, {}};
    ASSERT_TRUE(harness.store->apply({&command, 1}));
  }
  const auto none = read_recordings(*harness.store, wanted);
  ASSERT_TRUE(none);
  EXPECT_TRUE(none->missions.empty());
  EXPECT_EQ(none->left_out.contradicted, 1u);
  EXPECT_EQ(none->left_out.annulled, 1u);
  wanted.only = {missions[0].key};
  EXPECT_EQ(read_recordings(*harness.store, wanted)->missions.size(), 1u);
}

}  // namespace
}  // namespace joulecast::server
