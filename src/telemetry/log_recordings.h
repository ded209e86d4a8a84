#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "telemetry/event_log.h"
#include "telemetry/recording.h"

namespace joulecast::telemetry {

// Samples left out for a value of one field that no robot reads (plausible_ranges()), or a clock.
struct BeyondRange {
  std::size_t samples = 0;
  double farthest = 0;  // from zero, of these values
};

// The missions of event logs, in the order in which they began.
struct LogRecordings {
  std::vector<Recording> recordings;          // their samples in order of time; a mission may hold none
  std::set<std::string, std::less<>> robots;  // all that occur, requested or not
  std::size_t samples_outside = 0;            // of no mission: before its start, or just after an end
  // Undecodable, late and limit-breaking messages and covariates, samples of one time, and damaged places.
  std::size_t unreadable = 0;
  // Of these, by field.
  std::map<std::string, BeyondRange> beyond_range{};
};

// Of a stream or log without them.
inline constexpr std::string_view robots_publish = "Robots publish ROBOT_TELEMETRY.<robot_id> (lcmtypes)";

// "CAMERA, ODOM"; "and more" behind the first ones.
[[nodiscard]] std::string channel_list(const std::set<std::string, std::less<>>& channels);
// Fault::invalid with the channels that a log has where none is of a robot.
[[nodiscard]] Result<void> need_robots(const std::string& log, const LogTally& tally);

// Reads LCM event logs, one going on where the other ends, into missions as the daemon would follow them
// (MissionTracker): telemetry outside declared missions forms implicit ones. `robot_id` picks one robot;
// empty: all. `passed`, where there is one, is called with every event that has been read. Fault::not_found
// for a file that cannot be opened, Fault::invalid for one that holds no event, and see need_robots().
Result<LogRecordings> read_recordings(std::span<const std::string> paths, const std::string& robot_id = {},
                                      const LogObserver& passed = {});

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
