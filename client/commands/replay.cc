#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "answers/mission.h"
#include "base/host_clock.h"
#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/listen.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/interrupt.h"
#include "client/log_progress.h"
#include "history/open_store.h"
#include "history/writer.h"
#include "ingest/forecasts.h"
#include "ingest/model_registry.h"
#include "ingest/pipeline.h"
#include "telemetry/event_log.h"
#include "telemetry/lcm_link.h"
#include "telemetry/log_recordings.h"

namespace joulecast::client {
namespace {

using Clock = std::chrono::steady_clock;

struct ReplayOptions {
  std::vector<std::string> logs;
  std::string lcm_url = usual_lcm_url();
  double speed = 1, max_rate_hz = 15'000;
  std::string into;                 // the history that the missions go into; created when absent
  std::vector<std::string> robots;  // files of robots that are not yet in the history
  std::string unit = energy_units.front();
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

// Reads a log until `take` returns false, and reports on standard error where and how it is damaged. False if
// `take` ended it.
Result<bool> read_log(const std::string& path, LogProgress& progress, telemetry::LogTally& tally,
                      const std::function<Result<bool>(const telemetry::LogEvent&)>& take) {
  const auto take_and_count = [&](const telemetry::LogEvent& event) -> Result<bool> {
    TRY_ASSIGN(const bool taken, take(event));
    if (taken) progress.passed(event);
    return taken;
  };
  return telemetry::read_events(path, take_and_count, tally, [&](const telemetry::LogRead& place) {
    fmt::print(stderr, "joulecast: {}: at byte {}: {}\n", path, place.offset, place.message);
  });
}

// The document of the missions of logs (--json).
std::string replayed_json(const std::vector<history::Mission>& missions, const telemetry::LogTally& tally,
                          const ingest::IngestCounters& counters) {
  JsonWriter json;
  json.begin_object().field("messages", tally.events).field("damaged_places", tally.damaged_places);
  json.field("skipped_bytes", tally.skipped_bytes).key("faults").begin_object();
  for (std::size_t k = 0; k < ingest::ingest_fault_count; ++k)
    json.field(ingest::ingest_fault_names[k], counters.faults[k].load());
  json.end_object().key("missions").begin_array();
  for (const history::Mission& mission : missions) answers::mission_table().write(json, mission);
  json.end_array().end_object();
  return json.text();
}

void print_replayed(const Json& document, const std::string& unit, double wall_s) {
  print_missions(document["missions"], {{"robot", "robot_id"},
                                        {"mission", "mission_id"},
                                        {"state", "state"},
                                        {"time s", "energy/duration_s", 1},
                                        {"driven m", "energy/distance_m", 1},
                                        energy_column("measured", "energy/measured_j", unit),
                                        energy_column("modelled", "energy/modelled_j", unit),
                                        energy_column("unexplained", "energy/unexplained_j", unit)});
  const double messages = number_at(document, "messages");
  fmt::print("{:.0f} messages in {:.2f} s ({:.0f} a second); * = incomplete\n", messages, wall_s,
             messages / std::max(wall_s, 1e-9));
  for (const auto& [fault, count] : document["faults"].items())
    if (count != 0) fmt::print("{}: {}\n", fault, count.dump());
}

// Robots with telemetry that could not be accounted for; returns their number.
std::size_t print_unknown_robots(const ingest::FleetView& fleet, const std::string& store_path) {
  std::size_t count = 0;
  for (const auto& robot : fleet.all()) {
    if (robot->has_model) continue;
    ++count;
    fmt::print(stderr, "joulecast: {}: {} has no model of this robot: pass its file with --robot\n",
               robot->robot_id, store_path);
  }
  return count;
}

// Runs logs straight through the daemon's ingest pipeline into a history, as fast as it takes them, and
// prints the missions that came of it. The same logs give the same bits in every account.
Result<Exit> replay_into(const ReplayOptions& options) {
  TRY_ASSIGN(const auto store, history::open_store(options.into).map_error([](Error error) {
    error.field = "--into";
    return error;
  }));
  ingest::IngestCounters counters;
  history::WriterOptions writing;
  history::Writer* reporter = nullptr;
  writing.on_reused_name = [&](const history::Mission& begun, history::MissionKey earlier) {
    ingest::report_reused_name(begun, earlier, begun.start_utime_us, counters,
                               [&](history::Command command) { (void)reporter->offer(std::move(command)); });
  };
  history::Writer writer(*store, std::move(writing));
  reporter = &writer;
  ingest::ModelRegistry models;
  for (const std::string& file : options.robots) {
    TRY_ASSIGN(const auto robot, ingest::read_robot_file(file));
    TRY(ingest::load_robot(robot, file, *store, writer, host_utime_us()));
  }
  TRY(ingest::load_stored_models(*store, models));

  ingest::FleetView fleet;
  std::set<history::MissionKey> touched;
  ingest::SessionOutputs outputs{*store,
                                 [&](history::Command command) {
                                   if (const auto* begun = std::get_if<history::StartMission>(&command))
                                     touched.insert(begun->mission.key);
                                   if (const Result<void> posted = writer.post(std::move(command)); !posted)
                                     report(posted.error());
                                 },
                                 fleet, counters,
                                 [](const std::string& robot, const std::string& text) {
                                   fmt::print(stderr, "joulecast: {}: {}\n", robot, text);
                                 }};
  ingest::Forecasts forecasts(*store);
  outputs.prepare = [&](const std::string& robot_id) { return forecasts.read(models.find(robot_id)); };
  outputs.mission_ended = [&](const ingest::SessionOutputs::Post& post,
                              const std::shared_ptr<const ingest::ModelInForce>& model,
                              forecast::PastMission mission) {
    post(history::PutLearned{forecasts.learn(model, std::move(mission))});
  };
  constexpr std::size_t any_number_of_robots = 1'000'000;
  ingest::Pipeline pipeline({}, any_number_of_robots, models, outputs);
  telemetry::LogTally tally;
  LogProgress progress("accounting", options.logs);
  const auto began = Clock::now();
  const auto take = [&](const telemetry::LogEvent& event) -> Result<bool> {
    if (const auto message = ingest::decode_message(event.channel, event.data, event.timestamp_us, counters))
      pipeline.handle(*message);
    return true;
  };
  for (const std::string& log : options.logs) TRY(read_log(log, progress, tally, take));
  TRY(telemetry::need_robots(options.logs.front(), tally));
  pipeline.finish();
  TRY(writer.flush());
  const double wall_s = std::chrono::duration<double>(Clock::now() - began).count();

  std::vector<history::Mission> missions;
  for (const history::MissionKey key : touched) {
    TRY_ASSIGN(auto mission, store->mission(key));
    missions.push_back(std::move(mission));
  }
  const std::string document = replayed_json(missions, tally, counters);
  if (options.json)
    std::puts(document.c_str());
  else
    print_replayed(Json::parse(document), options.unit, wall_s);
  const bool unknown = print_unknown_robots(fleet, options.into) > 0;
  return tally.damaged_places == 0 && !missions.empty() && !unknown ? Exit::ok : Exit::fault;
}

Result<Exit> run_replay(ReplayOptions& options) {
  if (!options.into.empty()) return replay_into(options);
  InterruptGuard interrupt;
  TRY_ASSIGN(auto link, telemetry::LcmLink::open(options.lcm_url));
  fmt::print(stderr, "publishing on {}\n", options.lcm_url);
  Pacer pacer(options.speed, options.max_rate_hz);
  telemetry::LogTally tally;
  LogProgress progress("replaying", options.logs);
  const auto began = Clock::now();
  const auto publish = [&](const telemetry::LogEvent& event) -> Result<bool> {
    // Waits shorter than the scheduler's grain are left to add up.
    const auto due = pacer.due(event.timestamp_us);
    if (due > Clock::now() + std::chrono::microseconds(200) || tally.events % 64 == 0)
      if (interrupt.wait_until(due)) return false;
    TRY(link.publish(std::string(event.channel), event.data));
    return true;
  };
  for (const auto& path : options.logs) {
    pacer.begin_log();
    TRY_ASSIGN(const bool finished, read_log(path, progress, tally, publish));
    if (!finished) break;
  }
  if (tally.events > 0) TRY(telemetry::need_robots(options.logs.front(), tally));
  const double wall_s = std::chrono::duration<double>(Clock::now() - began).count();
  fmt::print("replayed {} messages on {} in {:.1f} s; {} damaged places, {} bytes skipped\n", tally.events,
             options.lcm_url, wall_s, tally.damaged_places, tally.skipped_bytes);
  return tally.damaged_places == 0 ? Exit::ok : Exit::fault;
}

}  // namespace

void add_replay(CLI::App& program, Exit& exit) {
  using O = ReplayOptions;
  add_command<O>(
      program, exit, "replay", "Publish recorded LCM event logs, or write their missions into a history",
      run_replay,
      {{"log", &O::logs, "LCM event logs, in this order", file_of("lcmlog"), required},
       {"--lcm-url", &O::lcm_url, "LCM provider to publish on; default: JOULECAST_LCM_URL", named("URL")},
       {"--speed", &O::speed, "1 = as recorded, 10 = ten times faster, 0 = as fast as --max-rate allows",
        not_negative()},
       {"--max-rate", &O::max_rate_hz, "greatest number of messages a second", positive()},
       {"--into", &O::into,
        "write the missions of the logs into this history (SQLite file, or postgresql://...) instead of "
        "publishing",
        file_of("db")},
       {"--robot", &O::robots, "with --into: robot file of a robot that is not in the history; repeatable",
        file_of("json"), Needs{"--into"}},
       unit_row<O>(),
       {"--json", &O::json, "with --into: print the missions as JSON", Needs{"--into"}}},
      "joulecast replay amr.lcmlog --speed 20\n"
      "joulecast replay amr.lcmlog --into history.db --robot amr.json");
}

}  // namespace joulecast::client
