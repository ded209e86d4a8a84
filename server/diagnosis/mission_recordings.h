#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "history/store.h"
#include "telemetry/recording.h"

namespace joulecast::server {

// Which missions of a robot's history to read back, newest first.
struct RecordingsWanted {
  std::string robot_id;
  std::optional<std::int64_t> since_utime_us;  // missions that started earlier are left out
  std::set<history::MissionKey> except;
  std::vector<history::MissionKey>
      only;  // empty: any; else exactly these, Fault::not_found for another robot's
  std::size_t max_missions = 100;
  std::size_t max_samples = 400'000;  // missions that would go beyond are left out
  // Of the robot's battery. Samples that were taken while it was charged are removed, as they are no cost of
  // its motion; the capacity helps to detect them.
  double battery_capacity_ah = 0;
};

struct StoredRecording {
  history::MissionKey key = 0;
  std::int64_t start_utime_us = 0;
  telemetry::Recording recording;  // in order of time
};

// Missions that were looked at and not taken, by reason; and samples of those that were.
struct LeftOut {
  std::size_t excepted = 0;
  std::size_t open = 0;          // still
  std::size_t no_telemetry = 0;  // the retention dropped it
  std::size_t contradicted = 0;  // its channels contradict each other; not if it was requested by name
  std::size_t annulled = 0;
  std::size_t too_many = 0;  // beyond the bounds
  std::size_t charging_samples = 0;
};

struct StoredRecordings {
  std::vector<StoredRecording> missions;  // oldest first
  std::size_t samples = 0;
  LeftOut left_out;
};

// Reads raw telemetry back from the store. An empty result is no error.
Result<StoredRecordings> read_recordings(const history::Store& store, const RecordingsWanted& wanted);

}  // namespace joulecast::server
