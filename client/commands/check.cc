#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <ranges>
#include <string>
#include <utility>
#include <vector>

#include "base/json_text.h"
#include "base/try.h"
#include "client/commands/check_findings.h"
#include "client/commands/import.h"
#include "client/commands/listen.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/log_progress.h"
#include "dynamics/drive_model.h"
#include "robot/review.h"
#include "robot/robot_file.h"
#include "telemetry/event_log.h"
#include "telemetry/log_recordings.h"

namespace joulecast::client {
namespace {

struct CheckOptions {
  std::vector<std::string> files;
  std::string mapping, robot, robot_id, server, lcm_url = usual_lcm_url();
  double seconds = 10;
  bool json = false;
};

enum class Kind { robot, mapping, bag_mapping, log, table };

// The checked objects and the results.
struct Report {
  Json subjects = Json::array();
  Findings findings;
  telemetry::ChannelWatch watch;
  std::optional<robot::RobotModel> robot;  // with which recordings are compared

  void add(const std::string& name, const char* kind, Json more = Json::object()) {
    more["name"] = name;
    more["kind"] = kind;
    subjects.push_back(std::move(more));
  }
};

Result<Kind> kind_of(const std::string& path) {
  if (std::error_code unreadable; std::filesystem::is_directory(path, unreadable))
    return invalid(path, "is a folder");
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(Fault::not_found, path, "cannot be opened");
  std::array<unsigned char, 4> first{};
  file.read(reinterpret_cast<char*>(first.data()), first.size());
  if (file.gcount() == 0) return invalid(path, "is empty");
  std::uint32_t word = 0;
  for (const unsigned char byte : first) word = word << 8 | byte;
  if (word == telemetry::log_sync_word) return Kind::log;
  const auto text = std::find_if(first.begin(), first.end(), [](unsigned char c) { return c > ' '; });
  if (text == first.end() || (*text != '{' && *text != '[')) return Kind::table;
  TRY_ASSIGN(const auto content, read_file(path));
  const Json document = Json::parse(content, nullptr, false);
  const auto has_any = [&](std::initializer_list<const char*> members) {
    return document.is_object() &&
           std::ranges::any_of(members, [&](const char* name) { return document.contains(name); });
  };
  return has_any({"fields", "time", "covariates", "tables"})          ? Kind::mapping
         : has_any({"topics", "joints", "battery_current", "hold_s"}) ? Kind::bag_mapping
                                                                      : Kind::robot;
}

void check_model(const robot::RobotModel& model, const std::string& name, Report& report) {
  if (const auto effects = dynamics::active_effects(model); !effects)
    report.findings.push_back({true, name, effects.error().field, effects.error().message});
  for (const robot::ReviewFinding& f : robot::review(model))
    report.findings.push_back({f.fault, name, f.field, f.says, f.value});
}

Result<void> check_robot_file(const std::string& path, Report& report) {
  TRY_ASSIGN(const auto text, read_file(path));
  const auto document = parse_json(text);
  report.add(path, "robot");
  if (!document) {
    report.findings.push_back({true, path, document.error().field, document.error().message});
    return {};
  }
  const auto problems = robot::problems_of(*document);
  for (const FieldFault& problem : problems)
    report.findings.push_back({true, path, problem.field, problem.says});
  if (!problems.empty()) return {};
  const robot::RobotModel model = robot::read_robot(*document).value();
  check_model(model, path, report);
  const robot::Figures figures = robot::figures_of(model);
  report.subjects.back()["figures"] = {
      {"top_speed_m_s", figures.top_speed_m_s},
      {"acceleration_m_s2", figures.acceleration_m_s2},
      {"energy_wh", figures.energy_wh},
      {"standing_h", model.idle_power_w > 0 ? Json(figures.standing_h) : Json()}};
  return {};
}

Result<void> check_mapping(const std::string& path, Report& report) {
  TRY_ASSIGN(const auto text, read_file(path));
  report.add(path, "mapping");
  for (const auto& [field, says] : telemetry::mapping_faults(text))
    report.findings.push_back({true, path, field, says});
  const auto mapping = telemetry::ImportMapping::parse(text);
  if (!mapping) return {};
  for (const auto& [field, says] : telemetry::suspicious(*mapping))
    report.findings.push_back({false, path, field, says});
  return {};
}

Result<void> check_mapping_of_bags(const std::string& path, Report& report) {
  report.add(path, "mapping of bags");
  const auto checked = check_bag_mapping(path);
  if (!checked && checked.error().fault != Fault::invalid) return checked;
  if (!checked) report.findings.push_back({true, path, "", checked.error().message});
  return {};
}

// Recordings of one robot against the robot file, as far as there is one.
void check_recordings(Result<telemetry::RecordingSet> set, const std::string& name, Report& report) {
  if (!set)
    report.findings.push_back({set.error().field == "utime", name, "",
                               "is not compared with the robot file: " + describe(set.error())});
  else if (report.robot)
    judge(std::move(*set), *report.robot, report.findings);
}

void check_channels(bool live, Report& report) {
  for (const auto& [channel, tally] : report.watch.channels()) {
    judge(channel, tally, live, report.findings);
    judge_fields(channel, tally, report.robot.has_value(), report.findings);
  }
}

Result<void> check_logs(const std::vector<std::string>& logs, const CheckOptions& options, Report& report) {
  telemetry::LogTally tally;
  std::optional<LogProgress> progress(std::in_place, "reading", logs);
  const auto take = [&](const telemetry::LogEvent& event) -> Result<bool> {
    progress->passed(event);
    const auto channel = telemetry::parse_channel(event.channel);
    if (channel && (options.robot_id.empty() || channel->robot_id == options.robot_id))
      report.watch.add(event.channel, event.data, event.timestamp_us);
    return true;
  };
  for (const std::string& log : logs) {
    const auto before = tally;
    TRY(telemetry::read_events(log, take, tally));
    report.add(log, "log", {{"events", tally.events - before.events}});
    if (tally.damaged_places > before.damaged_places)
      report.findings.push_back(
          {true, log, "",
           fmt::format("{} damaged places, {} bytes skipped", tally.damaged_places - before.damaged_places,
                       tally.skipped_bytes - before.skipped_bytes)});
  }
  if (auto has = telemetry::need_robots(logs.front(), tally); !has)
    report.findings.push_back({true, logs.front(), "", has.error().message});
  else if (report.watch.channels().empty())
    report.findings.push_back({true, logs.front(), "", "has no channel of robot " + options.robot_id});
  check_channels(false, report);
  progress.reset();
  if (report.robot) {
    progress.emplace("checking", logs);
    check_recordings(telemetry::load_recordings(logs, options.robot_id, progress->observer()), logs.front(),
                     report);
  }
  return {};
}

Result<void> check_tables(const std::vector<std::string>& tables, const CheckOptions& options,
                          Report& report) {
  TRY_ASSIGN(const auto mapping, read_mapping(options.mapping));
  telemetry::ImportOptions how;
  if (!options.robot_id.empty()) how.robot_id = options.robot_id;
  how.pause_us = 1'000'000;
  std::int64_t next_start_utime_us = telemetry::year_2000_utime_us;
  std::vector<telemetry::Recording> recordings;
  std::map<std::string, std::int64_t> next;
  for (const std::string& table : tables) {
    how.start_utime_us.reset();
    auto imports = import_table(table, mapping, how);
    // Missions without a date follow each other.
    if (!imports || imports->front().recording.samples.front().utime_us < telemetry::year_2000_utime_us) {
      how.start_utime_us = next_start_utime_us;
      imports = import_table(table, mapping, how);
    }
    report.add(table, "table");
    if (!imports) {
      std::string place = imports.error().field;
      if (place.starts_with(table + ": ")) place.erase(0, table.size() + 2);
      report.findings.push_back({true, table, std::move(place), imports.error().message});
      continue;
    }
    const telemetry::ImportReport& first = imports->front().report;
    for (const std::string& setting : first.notes | std::views::take(first.settings_detected))
      report.subjects.back()["settings"].push_back(setting);
    for (telemetry::Import& import : *imports) {
      judge(import, table, report.findings);
      number_on(import.recording, next);
      for (const signals::Sample& sample : import.recording.samples)
        report.watch.add(import.recording.robot_id, sample);
      next_start_utime_us = import.recording.samples.back().utime_us + how.pause_us;
      recordings.push_back(std::move(import.recording));
    }
  }
  check_channels(false, report);
  if (recordings.empty() || !report.robot) return {};
  const std::string id = recordings.front().robot_id;
  check_recordings(telemetry::make_recording_set(id, std::move(recordings)), tables.front(), report);
  return {};
}

Result<void> check_live(const CheckOptions& options, Report& report) {
  Listened listened;
  telemetry::Recording recording{options.robot_id, "live", signals::unmeasured, {}};
  const auto take = [&](const std::string& id, const signals::Sample& sample) {
    if (id == options.robot_id) recording.samples.push_back(sample);
  };
  std::fprintf(stderr, "listening on %s\n", options.lcm_url.c_str());
  TRY(listen({options.lcm_url, options.robot_id, options.seconds}, listened, {}, take));
  report.watch = std::move(listened.watch);
  report.add(options.robot_id, "robot over LCM", {{"seconds", options.seconds}});
  if (const std::string dropped = dropped_datagrams(listened); !dropped.empty())
    report.findings.push_back({false, options.lcm_url, "", "datagrams not accepted: " + dropped});
  if (recording.samples.empty()) {
    report.findings.push_back(
        {true, options.robot_id, "",
         fmt::format("no telemetry within {:g} s: {}", options.seconds,
                     report.watch.channels().empty()
                         ? why_silent(options.lcm_url, listened)
                         : "other robots publish on " + options.lcm_url + "; `joulecast spy` lists them")});
    return {};
  }
  check_channels(true, report);
  if (!report.robot) return {};
  std::vector<telemetry::Recording> one;
  one.push_back(std::move(recording));
  check_recordings(telemetry::make_recording_set(options.robot_id, std::move(one)), options.robot_id, report);
  return {};
}

Result<void> check_server(const CheckOptions& options, Report& report) {
  const Renamed renamed{{"id", "--robot-id"}};
  TRY_ASSIGN(const auto state, ask_object(options.server, robot_target(options.robot_id, "/state"), renamed));
  report.add(options.robot_id, "robot of a daemon", {{"state", state}});
  judge_state(state, options.robot_id, report.findings);
  if (!state["has_model"].get<bool>()) return {};
  TRY_ASSIGN(const auto detail, ask_object(options.server, robot_target(options.robot_id), renamed));
  TRY_ASSIGN(const auto model, robot::read_robot(detail["model"]));
  check_model(model, options.robot_id, report);
  return {};
}

Result<void> check_files(const CheckOptions& options, Report& report) {
  std::vector<std::string> logs, tables;
  for (const std::string& file : options.files) {
    TRY_ASSIGN(const auto kind, kind_of(file));
    if (kind == Kind::robot) TRY(check_robot_file(file, report));
    if (kind == Kind::mapping) TRY(check_mapping(file, report));
    if (kind == Kind::bag_mapping) TRY(check_mapping_of_bags(file, report));
    if (kind == Kind::log) logs.push_back(file);
    if (kind == Kind::table) tables.push_back(file);
  }
  if (!tables.empty() && options.mapping.empty())
    return invalid("--mapping", "is required: " + tables.front() + " is neither JSON nor an LCM event log");
  if (!tables.empty()) {
    TRY(check_mapping(options.mapping, report));
    TRY(check_tables(tables, options, report));
  }
  return logs.empty() ? Result<void>() : check_logs(logs, options, report);
}

std::string reach(double top_speed_m_s) {
  return top_speed_m_s > 0 ? fmt::format("the motors reach {:.3g} m/s", top_speed_m_s)
                           : "the motors cannot drive it";
}

void print_check(const Report& report) {
  for (const Json& subject : report.subjects) {
    const Json figures = subject.value("figures", Json());
    std::string text = subject["name"].get<std::string>() + ": " + subject["kind"].get<std::string>();
    if (figures.is_object())
      text += fmt::format("; {}, the battery holds {:.4g} Wh{}",
                          reach(figures["top_speed_m_s"].get<double>()), figures["energy_wh"].get<double>(),
                          figures["standing_h"].is_null()
                              ? ""
                              : fmt::format(", {:.1f} h at rest", figures["standing_h"].get<double>()));
    for (const Json& setting : subject.value("settings", Json::array()))
      text += "; " + setting.get<std::string>();
    fmt::print("{}\n", text);
  }
  for (const auto& [channel, tally] : report.watch.channels())
    fmt::print("{:<32} {:>8} message{}, {:.4g} a second\n", channel, tally.messages,
               tally.messages == 1 ? "" : "s", tally.rate_hz());
  print(report.findings);
  if (!report.robot && !report.watch.channels().empty())
    fmt::print("units and signs were not checked: that needs --robot FILE\n");
}

Result<Exit> run_check(CheckOptions& options) {
  Report found;
  if (!options.robot.empty()) {
    TRY_ASSIGN(found.robot, robot::load_robot(options.robot));
    if (options.files.empty() && options.robot_id.empty()) options.robot_id = found.robot->robot_id;
  }
  // With a daemon the argument names its robot, if it is not a file.
  if (!options.server.empty() && options.robot_id.empty() && options.files.size() == 1 &&
      !std::filesystem::exists(options.files.front()))
    options.robot_id = std::exchange(options.files, {}).front();
  if (options.files.empty() && options.robot_id.empty())
    return invalid("--robot-id", "is required without a file and without --robot");
  TRY(!options.files.empty()    ? check_files(options, found)
      : !options.server.empty() ? check_server(options, found)
                                : check_live(options, found));
  if (options.json) {
    Json out = to_json(found.watch);
    out["subjects"] = found.subjects;
    out["findings"] = to_json(found.findings);
    print_json(out);
  } else {
    print_check(found);
  }
  return exit_of(found.findings);
}

}  // namespace

void add_check(CLI::App& program, Exit& exit) {
  using O = CheckOptions;
  add_command<O>(
      program, exit, "check",
      "Report errors and suspicious values in robot files, mappings, recordings or a running robot",
      run_check,
      {{"file", &O::files,
        "robot files, import mappings, LCM event logs, or tables with --mapping; with --server, the robot; "
        "without a file, a running robot",
        file_of("json")},
       {"--robot", &O::robot, "robot file to compare recordings and running robots with", file_of("json")},
       {"--mapping", &O::mapping, "import mapping of tables: the meaning of their columns", file_of("json")},
       {"--robot-id", &O::robot_id, "the robot to check: a running one, or one of several in a recording",
        named("ROBOT")},
       {"--server", &O::server, "query a daemon for the running robot instead of LCM", named("URL")},
       {"--lcm-url", &O::lcm_url, "LCM provider to receive a running robot from; default: JOULECAST_LCM_URL",
        named("URL")},
       {"--seconds", &O::seconds, "time to listen, s", positive()},
       {"--json", &O::json, "print the findings as JSON"}},
      "joulecast check amr.json mapping.json\n"
      "joulecast check amr.lcmlog --robot amr.json --json");
}

}  // namespace joulecast::client
