#include "telemetry/recording.h"

#include "telemetry/codec.h"

namespace joulecast::telemetry {
namespace {

Result<void> write_event(EventLogWriter& log, const Recording& recording, MissionPhase phase,
                         std::int64_t utime_us) {
  const MissionEvent event{utime_us, recording.mission_id, phase, recording.payload_kg, {}};
  return encode_mission_event(recording.robot_id, event)
      .and_then([&](const std::vector<std::uint8_t>& bytes) {
        return log.write(utime_us, channel_of(Subject::mission_event, recording.robot_id), bytes);
      });
}

}  // namespace

Result<void> write_recording(EventLogWriter& log, const Recording& recording) {
  if (recording.samples.empty()) return invalid("samples", "a recording needs one sample at least");
  const std::string channel = channel_of(Subject::telemetry, recording.robot_id);
  auto written = write_event(log, recording, MissionPhase::started, recording.samples.front().utime_us);
  for (const Sample& sample : recording.samples) {
    if (!written) return written;
    written =
        encode_telemetry(recording.robot_id, sample).and_then([&](const std::vector<std::uint8_t>& bytes) {
          return log.write(sample.utime_us, channel, bytes);
        });
  }
  if (!written) return written;
  return write_event(log, recording, MissionPhase::finished, recording.samples.back().utime_us);
}

}  // namespace joulecast::telemetry
