#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "base/host_clock.h"
#include "base/try.h"
#include "client/commands/check_findings.h"
#include "client/commands/listen.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/wrapped.h"
#include "telemetry/log_recordings.h"

namespace joulecast::client {
namespace {

struct SpyOptions {
  std::string lcm_url = usual_lcm_url(), robot_id;
  double seconds = 0;
  bool json = false;
};

// As far as the terminal is wide, in whole characters of UTF-8.
std::string cut(const std::string& line, std::size_t width) {
  std::size_t shown = 0, at = 0;
  for (; at < line.size(); ++at)
    if ((static_cast<unsigned char>(line[at]) & 0xC0) != 0x80 && ++shown > width) break;
  return line.substr(0, at);
}

std::string values_of(const telemetry::ChannelTally& tally) {
  std::string text = tally.last_text;
  for (const telemetry::FieldTally& field : tally.fields)
    if (field.measured > 0)
      text += fmt::format("{}{} {:.4g}", text.empty() ? "" : "  ", field.name, field.last);
  return text;
}

std::string page(const std::string& lcm_url, const Listened& listened, std::int64_t now_utime_us,
                 std::size_t width) {
  std::string text =
      cut(fmt::format("{:<32} {:>9} {:>8} {:>7} {:>9}", "channel", "messages", "Hz", "silent", "clock"),
          width) +
      '\n';
  for (const auto& [channel, tally] : listened.watch.channels()) {
    const double silent_s = 1e-6 * static_cast<double>(now_utime_us - tally.last_utime_us);
    text += cut(fmt::format("{:<32} {:>9} {:>8.1f} {:>5.0f} s {:>+7.2f} s", channel, tally.messages,
                            tally.rate_hz(), silent_s, 1e-6 * static_cast<double>(tally.clock_ahead_us)),
                width) +
            '\n';
    if (const std::string values = values_of(tally); !values.empty())
      text += cut("    " + values, width) + '\n';
    if (const std::string faults = faults_of(tally); !faults.empty())
      text += cut("    faults: " + faults, width) + '\n';
  }
  if (listened.watch.channels().empty()) {
    text += why_silent(lcm_url, listened) + '\n';
  } else if (!listened.datagrams.other_channels.empty()) {
    text +=
        cut("other channels: " + telemetry::channel_list(listened.datagrams.other_channels), width) + '\n';
  }
  if (const std::string dropped = dropped_datagrams(listened); !dropped.empty())
    text += cut("datagrams not accepted: " + dropped, width) + '\n';
  return text;
}

Result<Exit> run_spy(SpyOptions& options) {
  const bool terminal = isatty(STDOUT_FILENO) == 1 && !options.json;
  // Without a terminal no live display is needed; ten seconds are enough for a summary.
  const double seconds = options.seconds > 0 ? options.seconds : terminal ? 0 : 10;
  auto redraw = [&](const Listened& listened) {
    if (!terminal) return;
    std::fputs(("\033[H\033[J" +
                page(options.lcm_url, listened, host_utime_us(), terminal_columns(STDOUT_FILENO, 10'000)) +
                "ctrl-C ends\n")
                   .c_str(),
               stdout);
    std::fflush(stdout);
  };
  if (!terminal) std::fprintf(stderr, "listening on %s\n", options.lcm_url.c_str());
  Listened listened;
  TRY(listen({options.lcm_url, options.robot_id, seconds}, listened, redraw));
  if (options.json)
    print_json(to_json(listened));
  else if (!terminal)
    std::fputs(
        page(options.lcm_url, listened, host_utime_us(), terminal_columns(STDOUT_FILENO, 10'000)).c_str(),
        stdout);
  return Exit::ok;
}

}  // namespace

void add_spy(CLI::App& program, Exit& exit) {
  using O = SpyOptions;
  add_command<O>(
      program, exit, "spy", "Show the messages of robots over LCM: channels, rates, last values and faults",
      run_spy,
      {{"--lcm-url", &O::lcm_url, "LCM provider to listen on; default: JOULECAST_LCM_URL", named("URL")},
       robot_row<O>("only this robot's channels"),
       {"--seconds", &O::seconds, "time to listen, s; 0: until ctrl-C on a terminal, otherwise 10 s",
        not_negative()},
       {"--json", &O::json, "print the channels as JSON at the end"}},
      "joulecast spy --seconds 3\njoulecast spy --seconds 3 --json");
}

}  // namespace joulecast::client
