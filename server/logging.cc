#include "server/logging.h"

#include <fmt/format.h>

#include <atomic>
#include <cstdio>

#include "base/host_clock.h"
#include "base/utc_time.h"

namespace joulecast {
namespace {

std::atomic<LogFormat> chosen_format{LogFormat::text};
std::atomic<LogLevel> least_level{LogLevel::info};

std::string_view name_of(LogLevel level) {
  constexpr std::string_view names[] = {"debug", "info", "warning", "error"};
  return names[static_cast<std::size_t>(level)];
}

std::string time_text(std::int64_t utime_us) {
  const std::int64_t rest = (utime_us % 1'000'000 + 1'000'000) % 1'000'000;
  return fmt::format("{}.{:06}Z", format_utc(utime_us, "%Y-%m-%dT%H:%M:%S"), rest);
}

// Control characters are escaped in both formats: no value can forge a line.
void append_escaped(std::string& line, std::string_view text, bool quotes) {
  for (const char c : text) {
    if (quotes && (c == '"' || c == '\\')) {
      line.push_back('\\');
      line.push_back(c);
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) {
      line += fmt::format("\\u{:04x}", static_cast<unsigned>(static_cast<unsigned char>(c)));
    } else {
      line.push_back(c);
    }
  }
}

}  // namespace

std::string format_log_line(LogFormat format, LogLevel level, std::string_view message,
                            const LogFields& fields, std::int64_t utime_us) {
  std::string line;
  if (format == LogFormat::json) {
    line = fmt::format(R"({{"time":"{}","level":"{}","message":")", time_text(utime_us), name_of(level));
    append_escaped(line, message, true);
    line.push_back('"');
    for (const auto& [name, value] : fields) {
      line += ",\"";
      append_escaped(line, name, true);
      line += "\":\"";
      append_escaped(line, value, true);
      line.push_back('"');
    }
    line.push_back('}');
    return line;
  }
  line = fmt::format("{} {:<7} ", time_text(utime_us).substr(11, 12), name_of(level));
  append_escaped(line, message, false);
  for (const auto& [name, value] : fields) {
    line += fmt::format("  {}=", name);
    append_escaped(line, value, false);
  }
  return line;
}

void configure_logging(LogFormat format, LogLevel level) {
  chosen_format = format;
  least_level = level;
}

void log(LogLevel level, std::string_view message, const LogFields& fields) {
  if (level < least_level) return;
  const std::string line = format_log_line(chosen_format, level, message, fields, host_utime_us()) + '\n';
  std::fwrite(line.data(), 1, line.size(), stderr);  // at once: stderr has a lock and no buffer
}

}  // namespace joulecast
