#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/json_text.h"
#include "client/commands/accepts.h"
#include "client/commands/check_findings.h"
#include "client/commands/import_sources.h"
#include "client/commands/listen.h"
#include "client/commands/table.h"
#include "client/commands/tally_json.h"
#include "client/files.h"
#include "client/http_client.h"
#include "client/lcm_url.h"
#include "client/log_progress.h"
#include "dynamics/drive_model.h"
#include "robot/review.h"
#include "robot/robot_file.h"
#include "telemetry/event_log.h"
#include "telemetry/recording_set.h"

namespace joulecast::client {
namespace {

using Json = nlohmann::json;

struct CheckOptions {
  std::vector<std::string> files;
  std::string mapping, robot, robot_id, server, lcm_url = usual_lcm_url();
  double seconds = 10;
  bool json = false;
};

enum class Kind { robot, mapping, log, table };

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
  const auto content = read_file(path);
  if (!content) return tl::unexpected(content.error());
  const Json document = Json::parse(*content, nullptr, false);
  return document.is_object() && document.contains("fields") ? Kind::mapping : Kind::robot;
}

void check_model(const robot::RobotModel& model, const std::string& name, Report& report) {
  if (const auto effects = dynamics::active_effects(model); !effects)
    report.findings.push_back({true, name, effects.error().field, effects.error().message});
  for (const robot::ReviewFinding& f : robot::review(model))
    report.findings.push_back({f.fault, name, f.field, f.says, f.value});
}

Result<void> check_robot_file(const std::string& path, Report& report) {
  const auto text = read_file(path);
  if (!text) return tl::unexpected(text.error());
  const auto document = parse_json(*text);
  report.add(path, "robot");
  if (!document) {
    report.findings.push_back({true, path, document.error().field, document.error().message});
    return {};
  }
  const auto problems = robot::problems_of(*document);
  for (const robot::RobotProblem& problem : problems)
    report.findings.push_back({true, path, problem.pointer, problem.says});
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
  const auto text = read_file(path);
  if (!text) return tl::unexpected(text.error());
  report.add(path, "mapping");
  for (const auto& [field, says] : telemetry::mapping_faults(*text))
    report.findings.push_back({true, path, field, says});
  const auto mapping = telemetry::ImportMapping::parse(*text);
  if (!mapping) return {};
  for (const auto& [field, says] : telemetry::suspicious(*mapping))
    report.findings.push_back({false, path, field, says});
  return {};
}

// Recordings of one robot against the robot file, as far as there is one.
void check_recordings(Result<telemetry::RecordingSet> set, const std::string& name, Report& report) {
  if (!set)
    report.findings.push_back({set.error().field == "utime", name, "",
                               "is not held against the robot file: " + describe(set.error())});
  else if (report.robot)
    judge(std::move(*set), *report.robot, report.findings);
}

void check_channels(bool live, Report& report) {
  for (const auto& [channel, tally] : report.watch.channels()) {
    judge(channel, tally, live, report.findings);
    if (!report.robot) judge_fields(channel, tally, report.findings);
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
    if (auto read = telemetry::read_events(log, take, tally); !read) return tl::unexpected(read.error());
    report.add(log, "log", {{"events", tally.events - before.events}});
    if (tally.damaged_places > before.damaged_places)
      report.findings.push_back(
          {true, log, "",
           fmt::format("{} damaged places, {} bytes skipped", tally.damaged_places - before.damaged_places,
                       tally.skipped_bytes - before.skipped_bytes)});
  }
  if (auto has = need_robots(logs.front(), tally); !has)
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
  const auto mapping = read_mapping(options.mapping);
  if (!mapping) return tl::unexpected(mapping.error());
  telemetry::ImportOptions how;
  if (!options.robot_id.empty()) how.robot_id = options.robot_id;
  std::vector<telemetry::Recording> recordings;
  std::map<std::string, std::int64_t> next;
  for (const std::string& table : tables) {
    auto imports = import_table(table, *mapping, how);
    report.add(table, "table");
    if (!imports) {
      report.findings.push_back({true, table, imports.error().field, imports.error().message});
      continue;
    }
    for (telemetry::Import& import : *imports) {
      judge(import, table, report.findings);
      number_on(import.recording, next);
      for (const signals::Sample& sample : import.recording.samples)
        report.watch.add(import.recording.robot_id, sample);
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
  if (auto heard = listen({options.lcm_url, options.robot_id, options.seconds}, listened, {}, take); !heard)
    return heard;
  report.watch = std::move(listened.watch);
  report.add(options.robot_id, "robot over LCM", {{"seconds", options.seconds}});
  if (const std::string dropped = dropped_datagrams(listened); !dropped.empty())
    report.findings.push_back({false, options.lcm_url, "", "datagrams not taken: " + dropped});
  if (recording.samples.empty()) {
    report.findings.push_back(
        {true, options.robot_id, "",
         fmt::format("was not heard within {:g} s: {}", options.seconds,
                     report.watch.channels().empty()
                         ? why_silent(options.lcm_url, listened)
                         : "others publish on " + options.lcm_url + "; `joulecast spy` shows them")});
    return {};
  }
  check_channels(true, report);
  if (!report.robot) return {};
  std::vector<telemetry::Recording> one;
  one.push_back(std::move(recording));
  check_recordings(telemetry::make_recording_set(options.robot_id, std::move(one)), options.robot_id, report);
  return {};
}

Result<Json> ask_daemon(const ServerAddress& server, const std::string& target) {
  const auto reply = http_request(server, HttpMethod::get, target, "", std::chrono::seconds(30));
  if (!reply) return tl::unexpected(reply.error());
  if (!reply->ok()) return tl::unexpected(error_of(*reply));
  Json document = Json::parse(reply->body, nullptr, false);
  if (!document.is_object()) return fail(Fault::corrupt, target, "did not answer with a JSON object");
  return document;
}

Result<void> check_server(const CheckOptions& options, Report& report) {
  const auto server = parse_server_url(options.server);
  if (!server) return tl::unexpected(server.error());
  const auto state = ask_daemon(*server, "/v1/robots/" + options.robot_id + "/state");
  if (!state) return tl::unexpected(state.error());
  report.add(options.robot_id, "robot of a daemon", {{"state", *state}});
  judge_state(*state, options.robot_id, report.findings);
  if (!(*state)["has_model"].get<bool>()) return {};
  const auto detail = ask_daemon(*server, "/v1/robots/" + options.robot_id);
  if (!detail) return tl::unexpected(detail.error());
  const auto model = robot::read_robot((*detail)["model"]);
  if (!model) return tl::unexpected(model.error());
  check_model(*model, options.robot_id, report);
  return {};
}

Result<void> check_files(const CheckOptions& options, Report& report) {
  std::vector<std::string> logs, tables;
  for (const std::string& file : options.files) {
    const auto kind = kind_of(file);
    if (!kind) return tl::unexpected(kind.error());
    Result<void> done;
    if (*kind == Kind::robot) done = check_robot_file(file, report);
    if (*kind == Kind::mapping) done = check_mapping(file, report);
    if (!done) return done;
    if (*kind == Kind::log) logs.push_back(file);
    if (*kind == Kind::table) tables.push_back(file);
  }
  if (!tables.empty() && options.mapping.empty())
    return invalid("--mapping", "is needed: " + tables.front() + " is neither JSON nor an LCM event log");
  if (!tables.empty()) {
    if (auto done = check_mapping(options.mapping, report); !done) return done;
    if (auto done = check_tables(tables, options, report); !done) return done;
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
                              : fmt::format(", {:.3g} h standing", figures["standing_h"].get<double>()));
    fmt::print("{}\n", text);
  }
  for (const auto& [channel, tally] : report.watch.channels())
    fmt::print("{:<32} {:>8} messages, {:.4g} a second\n", channel, tally.messages, tally.rate_hz());
  print(report.findings);
}

Exit run_check(CheckOptions options) {
  Report found;
  if (!options.robot.empty()) {
    auto robot = robot::load_robot(options.robot);
    if (!robot) return report(robot.error());
    found.robot = std::move(*robot);
    if (options.files.empty() && options.robot_id.empty()) options.robot_id = found.robot->robot_id;
  }
  if (options.files.empty() && options.robot_id.empty())
    return report(Error{Fault::invalid, "--robot-id", "is needed where neither a file nor --robot is given"});
  const auto done = !options.files.empty()    ? check_files(options, found)
                    : !options.server.empty() ? check_server(options, found)
                                              : check_live(options, found);
  if (!done) return report(done.error());
  if (options.json) {
    Json out = to_json(found.watch);
    out["subjects"] = found.subjects;
    out["findings"] = to_json(found.findings);
    std::puts(out.dump(2).c_str());
  } else {
    print_check(found);
  }
  return exit_of(found.findings);
}

}  // namespace

void add_check(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<CheckOptions>();
  auto* command = program.add_subcommand(
      "check", "Report errors and suspicious values in robot files, mappings, recordings or a running robot");
  command->add_option(
      "file", options->files,
      "robot files, import mappings, LCM event logs, or tables with --mapping; none: a running "
      "robot");
  command->add_option("--robot", options->robot,
                      "robot file that recordings and running robots are held against");
  command->add_option("--mapping", options->mapping, "of tables: the meaning of the columns");
  command->add_option("--robot-id", options->robot_id, "the robot, of several or running");
  command->add_option("--server", options->server, "query a daemon for the running robot instead of LCM");
  command
      ->add_option("--lcm-url", options->lcm_url,
                   "where to listen to the running robot; JOULECAST_LCM_URL without it")
      ->capture_default_str();
  command->add_option("--seconds", options->seconds, "how long to listen")
      ->check(positive())
      ->capture_default_str();
  command->add_flag("--json", options->json, "print the findings as JSON");
  command->callback([options, &exit] { exit = run_check(*options); });
}

}  // namespace joulecast::client
