#include "telemetry/log_recordings.h"

#include <gtest/gtest.h>

#include "telemetry/codec.h"
#include "temporary_file.h"

namespace joulecast::telemetry {
namespace {

Recording recording(const std::string& robot, const std::string& mission, std::int64_t start_utime_us) {
  Recording made{robot, mission, 2.5, {}};
  for (int k = 0; k < 5; ++k) {
    signals::Sample sample;
    sample.utime_us = start_utime_us + 100'000 * k;
    sample.sequence = k;
    sample.wheel_velocity_rad_s = {1.0 * k, -1.0 * k};
    made.samples.push_back(sample);
  }
  return made;
}

TEST(LogRecordings, RoundTripThroughLog) {
  const test::TemporaryFile file;
  auto log = EventLogWriter::create(file.path());
  ASSERT_TRUE(log);
  const std::vector<Recording> written{recording("a", "m-1", 1'000'000), recording("b", "m-1", 2'000'000),
                                       recording("a", "m-2", 3'000'000)};
  for (const Recording& r : written) ASSERT_TRUE(write_recording(*log, r));
  // After the end of its mission a sample belongs to none.
  signals::Sample late = written[2].samples.back();
  const auto bytes = encode_telemetry("a", late);
  ASSERT_TRUE(bytes);
  ASSERT_TRUE(log->write(4'000'000, channel_of(Subject::telemetry, "a"), *bytes));
  ASSERT_TRUE(log->close());

  const auto read = read_recordings({&file.path(), 1});
  ASSERT_TRUE(read) << describe(read.error());
  ASSERT_EQ(read->recordings.size(), written.size());
  for (std::size_t k = 0; k < written.size(); ++k) {
    EXPECT_EQ(read->recordings[k].robot_id, written[k].robot_id);
    EXPECT_EQ(read->recordings[k].mission_id, written[k].mission_id);
    EXPECT_EQ(read->recordings[k].payload_kg, written[k].payload_kg);
    ASSERT_EQ(read->recordings[k].samples.size(), written[k].samples.size());
    for (std::size_t i = 0; i < written[k].samples.size(); ++i) {
      EXPECT_EQ(read->recordings[k].samples[i].utime_us, written[k].samples[i].utime_us);
      EXPECT_EQ(read->recordings[k].samples[i].wheel_velocity_rad_s,
                written[k].samples[i].wheel_velocity_rad_s);
    }
  }
  EXPECT_EQ(read->samples_outside, 1u);
  EXPECT_EQ(read->unreadable, 0u);
  EXPECT_EQ(read->robots, (std::set<std::string, std::less<>>{"a", "b"}));
}

TEST(LogRecordings, ReportForeignChannels) {
  const test::TemporaryFile file;
  auto log = EventLogWriter::create(file.path());
  ASSERT_TRUE(log);
  const std::vector<std::uint8_t> data(16);
  for (const char* channel : {"POSE", "CAMERA_LEFT", "POSE"})
    ASSERT_TRUE(log->write(1'000'000, channel, data));
  ASSERT_TRUE(log->close());
  const auto read = read_recordings({&file.path(), 1});
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().field, file.path());
  EXPECT_NE(read.error().message.find("but CAMERA_LEFT, POSE"), std::string::npos) << read.error().message;
}

TEST(LogRecordings, ReportMissingFile) {
  const std::string path = "no/such/file.lcmlog";
  const auto read = read_recordings({&path, 1});
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().fault, Fault::not_found);
}

}  // namespace
}  // namespace joulecast::telemetry
