#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "telemetry/recording.h"

namespace joulecast::telemetry {

// The declared missions of an event log, in the order in which they began.
struct LogRecordings {
  std::vector<Recording> recordings;
  std::uint64_t samples_outside = 0;  // of no declared mission
  std::uint64_t unreadable = 0;  // messages and covariates that decode to nothing, break a limit or come late
  std::uint64_t skipped_bytes = 0;  // damage in the file
};

// Reads a log back into the recordings that write_recording() makes of it. Samples that do not advance the
// robot's clock are dropped as unreadable. Fault::not_found when the file cannot be opened.
Result<LogRecordings> read_recordings(const std::string& log_path);

}  // namespace joulecast::telemetry
