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

}  // namespace joulecast::telemetry
