#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/replay_into.h"
#include "client/commands/table.h"
#include "client/interrupt.h"
#include "telemetry/event_log.h"
#include "telemetry/lcm_link.h"

namespace joulecast::client {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::vector<std::string> logs;
  std::string lcm_url = "udpm://239.255.76.67:7667?ttl=0";
  double speed = 1;
  double max_rate_hz = 15'000;
  std::string into;
  std::vector<std::string> robots;
  bool json = false;
};

struct Tally {
  std::uint64_t messages = 0;
  std::uint64_t damaged_places = 0;
  std::uint64_t skipped_bytes = 0;
};

// When each message may go: by the log's own clock, and never faster than the ceiling. LCM has no flow
// control, so without a ceiling a receiver loses messages and neither side is told.
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
    // A sender held up may catch up a little, not send all that it missed at once.
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

Result<bool> replay_log(const std::string& path, telemetry::LcmLink& link, Pacer& pacer,
                        InterruptGuard& interrupt, Tally& tally) {
  auto reader = telemetry::EventLogReader::open(path);
  if (!reader) return tl::unexpected<Error>(reader.error());
  pacer.begin_log();
  for (;;) {
    const telemetry::LogRead read = reader->next();
    switch (read.status) {
      case telemetry::LogStatus::event: {
        // Waits shorter than the scheduler's grain are left to add up.
        const auto due = pacer.due(read.event.timestamp_us);
        if (due > Clock::now() + std::chrono::microseconds(200) || tally.messages % 64 == 0) {
          if (interrupt.wait_until(due)) return true;
        }
        if (auto sent = link.publish(std::string(read.event.channel), read.event.data); !sent) {
          return tl::unexpected<Error>(sent.error());
        }
        ++tally.messages;
        break;
      }
      case telemetry::LogStatus::end:
        return false;
      case telemetry::LogStatus::truncated:
      case telemetry::LogStatus::corrupt:
        ++tally.damaged_places;
        std::fprintf(stderr, "joulecast: %s: at byte %llu: %s\n", path.c_str(),
                     static_cast<unsigned long long>(read.offset), read.message.c_str());
        tally.skipped_bytes += reader->resync();
        break;
      case telemetry::LogStatus::failed:
        return fail(Fault::unavailable, path, read.message);
    }
  }
}

Exit run(const Options& options) {
  if (!options.into.empty()) return replay_into({options.logs, options.into, options.robots, options.json});
  InterruptGuard interrupt;
  auto link = telemetry::LcmLink::open(options.lcm_url);
  if (!link) return report(link.error());
  Pacer pacer(options.speed, options.max_rate_hz);
  Tally tally;
  const auto began = Clock::now();
  for (const auto& path : options.logs) {
    const auto stopped = replay_log(path, *link, pacer, interrupt, tally);
    if (!stopped) return report(stopped.error());
    if (*stopped) break;
  }
  const double wall_s = std::chrono::duration<double>(Clock::now() - began).count();
  std::printf("replayed %llu messages in %.1f s; %llu damaged places, %llu bytes skipped\n",
              static_cast<unsigned long long>(tally.messages), wall_s,
              static_cast<unsigned long long>(tally.damaged_places),
              static_cast<unsigned long long>(tally.skipped_bytes));
  return tally.damaged_places == 0 ? Exit::ok : Exit::fault;
}

}  // namespace

void add_replay(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<Options>();
  auto* command = program.add_subcommand(
      "replay", "Publish recorded LCM event logs again, or run them straight into a history");
  command->add_option("log", options->logs, "LCM event logs, one after another")->required();
  command->add_option("--lcm-url", options->lcm_url, "LCM provider to publish on")->capture_default_str();
  command
      ->add_option("--speed", options->speed,
                   "1 = as recorded, 10 = ten times faster, 0 = as fast as --max-rate lets")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--max-rate", options->max_rate_hz, "messages a second that the receivers can take")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  auto* into = command->add_option("--into", options->into,
                                   "no LCM: account for the logs at once, into this history (SQLite file)");
  command
      ->add_option("--robot", options->robots,
                   "with --into: robot file of a robot that the history does not know; may be repeated")
      ->needs(into);
  command->add_flag("--json", options->json, "with --into: print the missions as JSON")->needs(into);
  command->callback([options, &exit] { exit = run(*options); });
}

}  // namespace joulecast::client
