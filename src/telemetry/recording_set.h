#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "telemetry/log_recordings.h"
#include "telemetry/recording.h"

namespace joulecast::telemetry {

// The missions of one robot, in the order of their beginning.
struct RecordingSet {
  std::string robot_id;
  std::vector<Recording> missions;
  std::size_t samples = 0;
  std::size_t unreadable = 0;                         // of LogRecordings
  std::map<std::string, BeyondRange> beyond_range{};  // of LogRecordings
  std::vector<std::string> notes;                     // joined missions, and omitted data
};

// Missions shorter than this are too short for conclusions on their own [s].
inline constexpr double shortest_mission_s = 5.0;

// " (in mA?)": the probable unit of a field's readings that are outside the range of all robots; empty: none.
std::string in_other_unit(std::string_view field, double value);

// Fault::invalid where no message of the logs is of the robot, or of any where `robot_id` is empty.
Result<void> need_robot(const LogRecordings& log, const std::string& robot_id);

// The missions of one robot in event logs (read_recordings). Where several robots are recorded, `robot_id`
// picks one; empty: the logs must hold one robot only. Errors of read_recordings, and Fault::invalid without
// a usable mission.
Result<RecordingSet> load_recordings(std::span<const std::string> paths, const std::string& robot_id = {},
                                     const LogObserver& passed = {});

// The same from samples in memory, put in order. Short missions that follow each other with the same payload
// are joined; missions that are still too short are left out; `notes` names both.
Result<RecordingSet> make_recording_set(std::string robot_id, std::vector<Recording> missions);

}  // namespace joulecast::telemetry
