#pragma once

#include <string>
#include <vector>

#include "client/progress.h"
#include "telemetry/event_log.h"

namespace joulecast::client {

// Progress of the reading of event logs, in bytes of the files.
class LogProgress {
 public:
  LogProgress(const std::string& work, const std::vector<std::string>& logs);
  void passed(const telemetry::LogEvent& event);
  // Not to outlive this.
  [[nodiscard]] telemetry::LogObserver observer() {
    return [this](const telemetry::LogEvent& event) { passed(event); };
  }

 private:
  std::uint64_t bytes_ = 0;
  Progress progress_;
};

}  // namespace joulecast::client
