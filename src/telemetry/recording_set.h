#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "telemetry/recording.h"

namespace joulecast::telemetry {

// The missions of one robot, in the order of their beginning.
struct RecordingSet {
  std::string robot_id;
  std::vector<Recording> missions;
  std::size_t samples = 0;
  std::size_t unreadable = 0;  // messages that no sample, event or covariate could be read from
  std::vector<std::string> notes;  // sentences: missions that were joined or left out, messages not read
};

// Missions shorter than this say nothing by themselves [s].
inline constexpr double shortest_mission_s = 5.0;

// Reads LCM event logs of one robot into missions. Where several robots are recorded, `robot_id` picks one;
// empty: the log must hold one robot only. Telemetry outside declared missions forms implicit ones.
// Fault::not_found for a file that cannot be opened, Fault::invalid without a usable mission.
Result<RecordingSet> load_recordings(std::span<const std::string> paths, const std::string& robot_id = {});

// The same from samples in memory: sorted, duplicates dropped. Short missions that follow each other with the same
// payload are joined; what is still too short is left out; `notes` names both.
Result<RecordingSet> make_recording_set(std::string robot_id, std::vector<Recording> missions);

}  // namespace joulecast::telemetry
