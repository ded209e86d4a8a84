#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

// The process's log: one line per event on standard error, as JSON objects or as text for a terminal.
namespace joulecast {

enum class LogLevel : std::uint8_t { debug, info, warning, error };
enum class LogFormat : std::uint8_t { text, json };

// Fields of an event in addition to its message, e.g. {"robot_id", "amr-07"}.
using LogFields = std::vector<std::pair<std::string_view, std::string>>;

// The default is text at level info.
void configure_logging(LogFormat format, LogLevel level);

void log(LogLevel level, std::string_view message, const LogFields& fields = {});

// The line of an event, without its newline; what log() writes.
std::string format_log_line(LogFormat format, LogLevel level, std::string_view message,
                            const LogFields& fields, std::int64_t utime_us);

inline void log_info(std::string_view message, const LogFields& fields = {}) {
  log(LogLevel::info, message, fields);
}
inline void log_warning(std::string_view message, const LogFields& fields = {}) {
  log(LogLevel::warning, message, fields);
}
inline void log_error(std::string_view message, const LogFields& fields = {}) {
  log(LogLevel::error, message, fields);
}
inline void log_error(std::string_view message, const Error& error) {
  log(LogLevel::error, message, {{"cause", describe(error)}});
}

}  // namespace joulecast
