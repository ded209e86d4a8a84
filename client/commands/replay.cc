#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/accepts.h"
#include "client/commands/listen.h"
#include "client/commands/replay_into.h"
#include "client/commands/table.h"
#include "client/interrupt.h"
#include "client/lcm_url.h"
#include "client/log_progress.h"
#include "telemetry/event_log.h"
#include "telemetry/lcm_link.h"

namespace joulecast::client {
namespace {

using Clock = std::chrono::steady_clock;

struct ReplayOptions {
  std::vector<std::string> logs;
  std::string lcm_url = usual_lcm_url();
  double speed = 1;
  double max_rate_hz = 15'000;
  std::string into;
  std::vector<std::string> robots;
  bool json = false;
};

// When each message may go: by the log's own clock, and never faster than the ceiling. LCM has no flow
// control, so without a ceiling a receiver loses messages and neither side notices.
class Pacer {
 public:
  Pacer(double speed, double max_rate_hz) : speed_(speed), gap_(to_duration(1 / max_rate_hz)) {}

  void begin_log() { begun_ = false; }

  Clock::time_point due(std::int64_t timestamp_us) {
    const auto now = Clock::now();
    if (!begun_) {
      begun_ = true;
      first_us_ = timestamp_us;
      began_ = now;
    }
    Clock::time_point at = earliest_;
    if (speed_ > 0) {
      const double log_s = 1e-6 * static_cast<double>(timestamp_us - first_us_);
      at = std::max(at, began_ + to_duration(log_s / speed_));
    }
    // A delayed sender may catch up a little, but not send all delayed messages in a burst.
    earliest_ = std::max(at, now - 20 * gap_) + gap_;
    return at;
  }

 private:
  static Clock::duration to_duration(double seconds) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  }

  double speed_;
  Clock::duration gap_;
  bool begun_ = false;
  std::int64_t first_us_ = 0;
  Clock::time_point began_;
  Clock::time_point earliest_;
};

// Publishes the log; false when interrupted.
Result<bool> replay_log(const std::string& path, telemetry::LcmLink& link, Pacer& pacer,
                        InterruptGuard& interrupt, LogProgress& progress, telemetry::LogTally& tally) {
  pacer.begin_log();
  const auto publish = [&](const telemetry::LogEvent& event) -> Result<bool> {
    // Waits shorter than the scheduler's grain are left to add up.
    const auto due = pacer.due(event.timestamp_us);
    if (due > Clock::now() + std::chrono::microseconds(200) || tally.events % 64 == 0) {
      if (interrupt.wait_until(due)) return false;
    }
    if (auto sent = link.publish(std::string(event.channel), event.data); !sent) {
      return tl::unexpected(std::move(sent.error()));
    }
    progress.passed(event);
    return true;
  };
  return telemetry::read_events(path, publish, tally,
                                [&](const telemetry::LogRead& place) { tell_damage(path, place); });
}

Exit run_replay(const ReplayOptions& options) {
  if (!options.into.empty()) return replay_into({options.logs, options.into, options.robots, options.json});
  InterruptGuard interrupt;
  auto link = telemetry::LcmLink::open(options.lcm_url);
  if (!link) return report(link.error());
  std::fprintf(stderr, "publishing on %s\n", options.lcm_url.c_str());
  Pacer pacer(options.speed, options.max_rate_hz);
  telemetry::LogTally tally;
  LogProgress progress("replaying", options.logs);
  const auto began = Clock::now();
  for (const auto& path : options.logs) {
    const auto finished = replay_log(path, *link, pacer, interrupt, progress, tally);
    if (!finished) return report(finished.error());
    if (!*finished) break;
  }
  if (auto has = need_robots(options.logs.front(), tally); !has && tally.events > 0)
    return report(has.error());
  const double wall_s = std::chrono::duration<double>(Clock::now() - began).count();
  std::printf("replayed %llu messages on %s in %.1f s; %llu damaged places, %llu bytes skipped\n",
              static_cast<unsigned long long>(tally.events), options.lcm_url.c_str(), wall_s,
              static_cast<unsigned long long>(tally.damaged_places),
              static_cast<unsigned long long>(tally.skipped_bytes));
  return tally.damaged_places == 0 ? Exit::ok : Exit::fault;
}

}  // namespace

void add_replay(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<ReplayOptions>();
  auto* command = program.add_subcommand(
      "replay", "Publish recorded LCM event logs, or write their missions into a history");
  command->add_option("log", options->logs, "LCM event logs, in this order")->required();
  command->add_option("--lcm-url", options->lcm_url, "LCM provider to publish on; default: JOULECAST_LCM_URL")
      ->capture_default_str();
  command
      ->add_option("--speed", options->speed,
                   "1 = as recorded, 10 = ten times faster, 0 = as fast as --max-rate allows")
      ->check(not_negative())
      ->capture_default_str();
  command->add_option("--max-rate", options->max_rate_hz, "greatest number of messages a second")
      ->check(positive())
      ->capture_default_str();
  auto* into = command->add_option("--into", options->into,
                                   "write the missions of the logs into this history (SQLite file, or "
                                   "postgresql://...) instead of publishing");
  command
      ->add_option("--robot", options->robots,
                   "with --into: robot file of a robot that is not in the history; repeatable")
      ->needs(into);
  command->add_flag("--json", options->json, "with --into: print the missions as JSON")->needs(into);
  command->callback([options, &exit] { exit = run_replay(*options); });
}

}  // namespace joulecast::client
