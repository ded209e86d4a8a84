#pragma once

#include <string>
#include <vector>

#include "client/commands/outcome.h"
#include "telemetry/event_log.h"

namespace joulecast::client {

struct ReplayInto {
  std::vector<std::string> logs;
  std::string store_path;  // a file or URL: the history that the missions go into; created when absent
  std::vector<std::string> robot_files;  // models of the robots that are not yet in the history
  bool json = false;
};

// Runs logs straight through the daemon's ingest pipeline into a history, as fast as it takes them, and
// prints the missions that came of it. The same logs give the same bits in every account.
Exit replay_into(const ReplayInto& options);

// Reports on standard error where and how a log is damaged.
void tell_damage(const std::string& path, const telemetry::LogRead& place);

}  // namespace joulecast::client
