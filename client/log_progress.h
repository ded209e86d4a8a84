#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "client/progress.h"
#include "telemetry/event_log.h"

namespace joulecast::client {

// Progress of the reading of event logs, in bytes of the files.
class LogProgress {
 public:
  LogProgress(const std::string& work, const std::vector<std::string>& logs)
      : progress_(work, "kB", total_bytes(logs) / kilobyte) {}
  void passed(const telemetry::LogEvent& event) {
    bytes_ += event_header_bytes + event.channel.size() + event.data.size();
    progress_.reach(bytes_ / kilobyte);
  }
  // Not to outlive this.
  [[nodiscard]] telemetry::LogObserver observer() {
    return [this](const telemetry::LogEvent& event) { passed(event); };
  }

 private:
  static constexpr std::uint64_t kilobyte = 1000, event_header_bytes = 28;

  // 0, for unknown, if a log is not a regular file. Errors are left to the reader of the log.
  static std::uint64_t total_bytes(const std::vector<std::string>& logs) {
    std::uint64_t bytes = 0;
    for (const auto& log : logs) {
      std::error_code fault;
      bytes += std::filesystem::file_size(log, fault);
      if (fault) return 0;
    }
    return bytes;
  }

  std::uint64_t bytes_ = 0;
  Progress progress_;
};

}  // namespace joulecast::client
