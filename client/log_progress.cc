#include "client/log_progress.h"

#include <filesystem>
#include <system_error>

namespace joulecast::client {
namespace {

constexpr std::uint64_t kilobyte = 1000;
constexpr std::uint64_t event_header_bytes = 28;

// Total size; 0, for unknown, if a log is not a regular file. Errors are left to the reader of the log.
std::uint64_t total_kilobytes(const std::vector<std::string>& logs) {
  std::uint64_t bytes = 0;
  for (const auto& log : logs) {
    std::error_code fault;
    const auto size = std::filesystem::file_size(log, fault);
    if (fault) return 0;
    bytes += size;
  }
  return bytes / kilobyte;
}

}  // namespace

LogProgress::LogProgress(const std::string& work, const std::vector<std::string>& logs)
    : progress_(work, "kB", total_kilobytes(logs)) {}

void LogProgress::passed(const telemetry::LogEvent& event) {
  bytes_ += event_header_bytes + event.channel.size() + event.data.size();
  progress_.reach(bytes_ / kilobyte);
}

}  // namespace joulecast::client
