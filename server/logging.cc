#include "server/logging.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <memory>

#include "base/host_clock.h"
#include "base/utc_time.h"

namespace joulecast {
namespace {

std::atomic<LogFormat> chosen_format{LogFormat::text};

spdlog::level::level_enum level_of(LogLevel level) {
  constexpr spdlog::level::level_enum levels[] = {spdlog::level::debug, spdlog::level::info,
                                                  spdlog::level::warn, spdlog::level::err};
  return levels[static_cast<std::size_t>(level)];
}

std::string_view name_of(LogLevel level) {
  constexpr std::string_view names[] = {"debug", "info", "warning", "error"};
  return names[static_cast<std::size_t>(level)];
}

spdlog::logger& logger() {
  static const std::shared_ptr<spdlog::logger> instance = [] {
    auto made =
        std::make_shared<spdlog::logger>("joulecast", std::make_shared<spdlog::sinks::stderr_sink_mt>());
    made->set_pattern("%v");
    made->set_level(spdlog::level::info);
    made->flush_on(spdlog::level::info);
    return made;
  }();
  return *instance;
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
  logger().set_level(level_of(level));
}

bool log_enabled(LogLevel level) {
  return logger().should_log(level_of(level));
}

void log(LogLevel level, std::string_view message, const LogFields& fields) {
  if (!log_enabled(level)) return;
  const std::string line = format_log_line(chosen_format, level, message, fields, host_utime_us());
  logger().log(level_of(level), spdlog::string_view_t(line.data(), line.size()));
}

void flush_log() {
  logger().flush();
}

}  // namespace joulecast
