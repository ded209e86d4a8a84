#include "client/commands/replay_into.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "answers/json/mission_json.h"
#include "base/host_clock.h"
#include "client/commands/listen.h"
#include "client/log_progress.h"
#include "history/open_store.h"
#include "history/writer.h"
#include "ingest/forecasts.h"
#include "ingest/model_loading.h"
#include "ingest/pipeline.h"
#include "telemetry/event_log.h"

namespace joulecast::client {
namespace {

using Clock = std::chrono::steady_clock;

Result<bool> read_log(const std::string& path, ingest::Pipeline& pipeline, ingest::IngestCounters& counters,
                      LogProgress& progress, telemetry::LogTally& tally) {
  const auto take = [&](const telemetry::LogEvent& event) -> Result<bool> {
    if (const auto message = ingest::decode_message(event.channel, event.data, event.timestamp_us, counters))
      pipeline.handle(*message);
    progress.passed(event);
    return true;
  };
  return telemetry::read_events(path, take, tally,
                                [&](const telemetry::LogRead& place) { tell_damage(path, place); });
}

void print_number(double value, const char* format) {
  std::isfinite(value) ? std::printf(format, value) : std::printf("%12s", "-");
}

void print_replayed(const std::vector<history::Mission>& missions) {
  std::printf("%-16s %-20s %-12s %9s %9s %12s %12s %12s\n", "robot", "mission", "state", "time s", "driven m",
              "measured J", "modelled J", "unexplained");
  for (const history::Mission& m : missions) {
    const signals::Accounts& a = m.accounts;
    std::printf("%-16s %-20s %-12s %9.1f %9.1f ", m.robot_id.c_str(), m.mission_id.c_str(),
                (std::string(history::name(m.state)) + (m.incomplete ? "*" : "")).c_str(), a.duration_s,
                a.distance_m);
    print_number(a.measured_s > 0 ? a.measured_j : NAN, "%12.2f");
    print_number(a.modelled_j, " %12.2f");
    print_number(a.measured_s > 0 ? a.ledger[signals::Term::unexplained] : NAN, " %12.2f");
    std::printf("\n");
  }
}

// Robots with telemetry that could not be accounted for; returns their number.
std::size_t print_unknown_robots(const ingest::FleetView& fleet, const std::string& store_path) {
  std::size_t count = 0;
  for (const auto& robot : fleet.all()) {
    if (robot->has_model) continue;
    ++count;
    std::fprintf(stderr, "joulecast: %s: %s has no model of this robot: pass its file with --robot\n",
                 robot->robot_id.c_str(), store_path.c_str());
  }
  return count;
}

}  // namespace

void tell_damage(const std::string& path, const telemetry::LogRead& place) {
  std::fprintf(stderr, "joulecast: %s: at byte %llu: %s\n", path.c_str(),
               static_cast<unsigned long long>(place.offset), place.message.c_str());
}

Exit replay_into(const ReplayInto& options) {
  auto store = history::open_store(options.store_path);
  if (!store) return report(store.error());
  history::Writer writer(**store, {});
  ingest::ModelRegistry models;
  for (const std::string& file : options.robot_files) {
    const auto robot = ingest::read_robot_file(file);
    if (!robot) return report(robot.error());
    if (Result<void> loaded = ingest::load_robot(*robot, file, **store, writer, host_utime_us()); !loaded)
      return report(loaded.error());
  }
  if (Result<void> loaded = ingest::load_stored_models(**store, models); !loaded)
    return report(loaded.error());

  ingest::FleetView fleet;
  ingest::IngestCounters counters;
  std::set<history::MissionKey> touched;
  ingest::SessionOutputs outputs{**store,
                                 [&](history::Command command) {
                                   if (const auto* begun = std::get_if<history::StartMission>(&command))
                                     touched.insert(begun->mission.key);
                                   if (const Result<void> posted = writer.post(std::move(command)); !posted)
                                     report(posted.error());
                                 },
                                 fleet, counters,
                                 [](const std::string& robot, const std::string& text) {
                                   std::fprintf(stderr, "joulecast: %s: %s\n", robot.c_str(), text.c_str());
                                 }};
  ingest::Forecasts forecasts(**store);
  outputs.mission_ended = [&](const ingest::SessionOutputs::Post& post,
                              const std::shared_ptr<const ingest::ModelInForce>& model,
                              forecast::PastMission mission) {
    post(history::PutLearned{forecasts.learn(model, std::move(mission)).document});
  };
  constexpr std::size_t any_number_of_robots = 1'000'000;
  ingest::Pipeline pipeline({}, any_number_of_robots, models, outputs);
  telemetry::LogTally tally;
  LogProgress progress("accounting", options.logs);
  const auto began = Clock::now();
  for (const std::string& log : options.logs) {
    if (Result<bool> read = read_log(log, pipeline, counters, progress, tally); !read)
      return report(read.error());
  }
  if (auto has = need_robots(options.logs.front(), tally); !has) return report(has.error());
  pipeline.finish();
  if (Result<void> flushed = writer.flush(); !flushed) return report(flushed.error());
  const double wall_s = std::chrono::duration<double>(Clock::now() - began).count();

  std::vector<history::Mission> missions;
  for (const history::MissionKey key : touched) {
    auto mission = (*store)->mission(key);
    if (!mission) return report(mission.error());
    missions.push_back(std::move(*mission));
  }
  if (options.json) {
    JsonWriter json;
    json.begin_object().field("messages", tally.events).field("damaged_places", tally.damaged_places);
    json.field("skipped_bytes", tally.skipped_bytes).key("faults").begin_object();
    for (std::size_t k = 0; k < ingest::ingest_fault_count; ++k)
      json.field(ingest::ingest_fault_names[k], counters.faults[k].load());
    json.end_object().key("missions").begin_array();
    for (const history::Mission& mission : missions) answers::mission_table().write(json, mission);
    json.end_array().end_object();
    std::printf("%s\n", json.text().c_str());
  } else {
    print_replayed(missions);
    std::printf("%llu messages in %.2f s (%.0f a second); * = incomplete\n",
                static_cast<unsigned long long>(tally.events), wall_s,
                static_cast<double>(tally.events) / std::max(wall_s, 1e-9));
    for (std::size_t k = 0; k < ingest::ingest_fault_count; ++k) {
      if (const auto count = counters.faults[k].load(); count > 0) {
        std::printf("%s: %llu\n", std::string(ingest::ingest_fault_names[k]).c_str(),
                    static_cast<unsigned long long>(count));
      }
    }
  }
  const bool unread =
      missions.empty() && counters.faults[static_cast<std::size_t>(ingest::IngestFault::undecodable)] > 0;
  const bool unknown = print_unknown_robots(fleet, options.store_path) > 0;
  return tally.damaged_places == 0 && !unread && !unknown ? Exit::ok : Exit::fault;
}

}  // namespace joulecast::client
