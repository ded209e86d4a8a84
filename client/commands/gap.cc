#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "answers/mission.h"
#include "base/host_clock.h"
#include "base/json_number.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "client/commands/print.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/interrupt.h"
#include "client/log_progress.h"
#include "client/progress.h"
#include "client/wrapped.h"
#include "describe/input.h"
#include "describe/table.h"
#include "energy/back_test.h"
#include "energy/power_windows.h"
#include "gap/diagnose/recordings.h"
#include "gap/groups/compare.h"
#include "gap/runs/diagnose_runs.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/diagnosis_json.h"
#include "report/report.h"
#include "robot/robot_file.h"
#include "telemetry/log_recordings.h"

namespace joulecast::client {
namespace {

struct GapOptions {
  std::vector<std::string> logs;
  std::vector<std::string> runs;  // CSV files, instead of logs
  std::vector<std::string> test;  // logs of other missions
  std::string robot_file, robot_id, server;
  std::string compare_by;  // groups to compare: "prefix" or "suffix" of the missions' ids, or a label
  std::string report;      // HTML file to write; empty: none
  std::string apply;       // robot file to write; empty: none
  std::string unit = energy_units.front();
  std::size_t max_missions = 200;
  std::vector<std::string> effect;  // to take of those that are not distinguished
  bool robot_model = false;         // diagnose the robot file, not the energies of a model in a table of runs
  bool adopt = false;               // in the daemon, after a back-test
  bool force = false;               // write in spite of the diagnosis's refusal, and over existing files
  bool json = false;

  gap::Choice choice() const { return {effect, force}; }
};

// Work with a progress line in per cent.
template <class Work>
auto with_progress(const char* activity, Work work) {
  Progress progress(activity, "%", 100);
  return work(progress.shares());
}

// Prints the document of a diagnosis, with --json as it is.
void show_diagnosis(const GapOptions& options, const nlohmann::ordered_json& document) {
  if (options.json)
    fmt::print("{}\n", document.dump(2));
  else
    print_diagnosis(document, options.unit);
}

// Writes the page of --report, if one is requested.
Result<void> write_page(const GapOptions& options, const nlohmann::ordered_json& document,
                        const robot::RobotModel& robot, const report::ReportOrigin& origin) {
  if (options.report.empty()) return {};
  return write_text_file(options.report, report::report_html(document, robot, origin),
                         existing(options.force));
}

// Writes the robot file of --apply with the effects found, or returns the refusal.
Result<void> apply_offer(const GapOptions& options, const gap::Offer& offer, const robot::RobotModel& robot) {
  const auto extended = gap::take(offer, robot, options.choice());
  if (!extended) return tl::unexpected(of_option(extended.error(), "--apply"));
  return write_text_file(options.apply, robot::to_json_text(*extended) + '\n', existing(options.force));
}

// The origin of a report: names of files without their folders, and the present time.
report::ReportOrigin report_origin(const std::vector<std::string>& sources, const std::string& robot_file) {
  report::ReportOrigin origin;
  for (const std::string& source : sources)
    origin.sources.push_back(std::filesystem::path(source).filename().string());
  origin.model = std::filesystem::path(robot_file).filename().string();
  origin.made_at = format_utc(host_utime_us());
  origin.software = "joulecast " JOULECAST_VERSION;
  return origin;
}

Result<gap::RunSet> read_tables(const GapOptions& options, const robot::RobotModel& robot) {
  std::vector<gap::RunFile> files;
  for (const std::string& name : options.runs) {
    TRY_ASSIGN(auto text, read_file(name));
    files.push_back({name, std::move(text)});
  }
  auto runs = gap::read_runs(files, robot);
  if (!runs) runs.error().message += "; joulecast gap --help lists the columns";
  return runs;
}

// Makes a comparison, prints it and writes its page.
Result<Exit> compare_and_print(const std::function<Result<gap::Comparison>(const gap::Progress&)>& compare,
                               const robot::RobotModel& robot, const GapOptions& options,
                               const report::ReportOrigin& origin) {
  TRY_ASSIGN(const auto comparison, with_progress("comparing", compare));
  const nlohmann::ordered_json document = gap::comparison_to_json(comparison);
  show_diagnosis(options, document);
  TRY(write_page(options, document, robot, origin));
  return Exit::ok;
}

Result<Exit> compare(const GapOptions& options, const gap::RunSet& runs, const robot::RobotModel& robot) {
  TRY_ASSIGN(const auto groups, runs.groups_by(options.compare_by));
  return compare_and_print(
      [&](const gap::Progress& progress) { return gap::compare_runs(runs, groups, robot, progress); }, robot,
      options, report_origin(options.runs, options.robot_file));
}

// The columns of a table of runs, for the help.
std::string run_columns_help() {
  constexpr std::size_t column_width = 28;
  std::string help = "Columns of a table of runs:";
  for (const gap::RunColumn& column : gap::run_columns()) {
    std::string row = "  " + std::string(column.name) +
                      (column.unit.empty() ? "" : std::string(" [").append(column.unit).append("]"));
    row.resize(std::max(row.size() + 1, column_width), ' ');
    help += '\n' + row + wrapped(column.meaning, help_width(), row.size());
  }
  return help;
}

// Diagnoses the gap from energies of whole runs.
Result<Exit> gap_from_missions(const GapOptions& options, const robot::RobotModel& robot) {
  TRY_ASSIGN(const auto runs, read_tables(options, robot));
  if (!options.compare_by.empty()) return compare(options, runs, robot);
  TRY_ASSIGN(const auto diagnosis, with_progress("diagnosing", [&](const gap::Progress& progress) {
               return gap::diagnose_runs(runs, robot, options.robot_model, progress);
             }));
  const nlohmann::ordered_json document = gap::runs_to_json(diagnosis);
  show_diagnosis(options, document);
  TRY(write_page(options, document, robot, report_origin(options.runs, options.robot_file)));
  if (!options.apply.empty()) TRY(apply_offer(options, gap::offer_of(diagnosis.diagnosis), robot));
  return Exit::ok;
}

constexpr std::chrono::milliseconds between_looks{250};

std::string diagnosis_target(const Json& job, const char* part = "") {
  return fmt::format("/v1/diagnoses/{}{}", job["id"].get<std::int64_t>(), part);
}

Result<Json> follow(const std::string& server, Json job) {
  InterruptGuard interrupt;
  Progress progress("diagnosing", "%", 100);
  const std::string target = diagnosis_target(job);
  while (job["state"] == "queued" || job["state"] == "running") {
    progress.reach(static_cast<std::uint64_t>(100 * number_or_nan(job["progress"])));
    if (interrupt.wait_until(std::chrono::steady_clock::now() + between_looks)) {
      if (const auto cancelled = ask(server, HttpMethod::del, target); !cancelled)
        return fail(Fault::conflict, "",
                    "interrupted; the diagnosis continues: " + describe(cancelled.error()));
      return fail(Fault::conflict, "", "interrupted; the diagnosis is cancelled");
    }
    TRY_ASSIGN(job, ask_object(server, target));
  }
  if (job["state"] != "done") {
    const std::string why = job["error"].is_string() ? job["error"].get<std::string>() : "";
    return fail(Fault::infeasible, "",
                fmt::format("the diagnosis {}: {}", job["state"].get<std::string>(), why));
  }
  return job;
}

void print_result(const Json& job) {
  fmt::print("diagnosis {} against model version {}, {} held back for the back-test\n",
             job["id"].get<std::int64_t>(), job["model_version"].get<std::int64_t>(),
             count_of(job["held_back"].size(), "mission"));
  print_diagnosis(job["result"]);
}

// Writes the diagnosed robot file with the effects found.
Result<void> write_model(const GapOptions& options, const Json& job) {
  TRY_ASSIGN(const gap::Offer offer, gap::offer_from_json(job["result"]));
  TRY_ASSIGN(const auto now, ask_object(options.server, robot_target(options.robot_id)));
  if (now["model_version"] != job["model_version"])
    return fail(Fault::conflict, "--apply", "another version of the model has come into force since");
  TRY_ASSIGN(const auto robot, robot::read_robot(now["model"]));
  return apply_offer(options, offer, robot);
}

// The result of the adoption; of a refused one, the problem with its back-test.
Result<Json> adopt_diagnosis(const GapOptions& options, const Json& job) {
  Json wanted = {{"diagnosis_id", job["id"]}, {"force", options.force}};
  if (!options.effect.empty()) wanted["effect"] = options.effect;
  TRY_ASSIGN(const auto reply,
             http_request(options.server, HttpMethod::post, robot_target(options.robot_id, "/models"),
                          wanted.dump(), std::chrono::minutes(1)));
  if (!reply.ok() && reply.status != 409) {
    Error error = error_of(reply);
    if (error.field == "/effect") error.field = "--effect";
    return tl::unexpected(std::move(error));
  }
  return object_of(reply.body, options.server);
}

void print_adopted_version(const Json& adoption, const std::string& unit) {
  if (adoption.contains("back_test")) print_back_test(adoption["back_test"], unit);
  if (adoption.value("adopted", false))
    fmt::print("adopted as model version {}\n", adoption["model_version"].get<std::int64_t>());
}

// Starts a daemon's diagnosis of a robot, follows the job and prints its result. An interrupt cancels it.
Result<Exit> gap_from_server(const GapOptions& options) {
  const Json wanted = {{"robot_id", options.robot_id}, {"max_missions", options.max_missions}};
  TRY_ASSIGN(const auto begun, ask(options.server, HttpMethod::post, "/v1/diagnoses", wanted.dump(),
                                   {{"/robot_id", "--robot-id"}, {"/max_missions", "--max-missions"}}));
  TRY_ASSIGN(auto first, object_of(begun.body, options.server));
  TRY_ASSIGN(const auto job, follow(options.server, std::move(first)));
  if (!options.report.empty()) {
    TRY_ASSIGN(const auto page, ask(options.server, HttpMethod::get, diagnosis_target(job, "/report")));
    TRY(write_text_file(options.report, page.body, existing(options.force)));
  }
  if (!options.json) print_result(job);
  Json out = job["result"];
  out["diagnosis_id"] = job["id"];
  std::vector<Error> refusals;
  if (!options.apply.empty())
    if (const auto written = write_model(options, job); !written) refusals.push_back(written.error());
  if (options.adopt) {
    TRY_ASSIGN(const auto adoption, adopt_diagnosis(options, job));
    out["adopted"] = adoption;
    if (!options.json) print_adopted_version(adoption, options.unit);
    if (!adoption.value("adopted", false))
      refusals.push_back({Fault::conflict, "--adopt", adoption.value("detail", "was refused")});
  }
  if (options.json) print_json(out);
  Exit exit = Exit::ok;
  for (const Error& refusal : refusals) exit = report(refusal);
  return exit;
}

// `joulecast gap --test`: a robot file and the one with the effects found, on missions that were not
// diagnosed; with enough battery power, also a linear regression on the missions that were.
struct GapTest {
  energy::BackTest replayed;
  Result<energy::RegressionComparison> beside_regression;

  // The objection to writing the corrected file; empty: there is none.
  std::string objection() const {
    if (!replayed.improves()) return "the back-test shows no improvement";
    if (!beside_regression || !beside_regression->missed.regression_wins()) return {};
    const energy::MissedPower& missed = beside_regression->missed;
    return fmt::format(
        "power error on the missions of --test: corrected file {:.1f} %, linear regression on the missions "
        "of the diagnosis {:.1f} %",
        100 * missed.corrected, 100 * missed.regression);
  }
};

Result<GapTest> test_on_other_missions(const std::vector<std::string>& logs, const std::string& robot_id,
                                       std::span<const telemetry::Recording> diagnosed,
                                       const robot::RobotModel& robot, const robot::RobotModel& corrected) {
  TRY_ASSIGN(const auto others, telemetry::load_recordings(logs, robot_id));
  for (const telemetry::Recording& mission : others.missions) {
    const auto same = [&](const telemetry::Recording& d) {
      return d.mission_id == mission.mission_id && !d.samples.empty() && !mission.samples.empty() &&
             d.samples.front().utime_us == mission.samples.front().utime_us;
    };
    if (std::ranges::any_of(diagnosed, same))
      return invalid("--test",
                     "mission " + mission.mission_id +
                         " is one of the diagnosis; a test needs missions that were not used in it");
  }
  std::vector<energy::DriveRun> runs;
  for (const telemetry::Recording& mission : others.missions)
    runs.push_back(
        {mission.mission_id, mission.samples, std::isfinite(mission.payload_kg) ? mission.payload_kg : 0});
  TRY_ASSIGN(auto replayed, energy::back_test(runs, robot, corrected));
  return GapTest{std::move(replayed),
                 energy::compare_with_regression(diagnosed, others.missions, robot, corrected)};
}

const auto regression_table =
    described::Table<energy::RegressionComparison>()
        .value("windows", AT(windows), "windows with new readings")
        .number_or_null("file_missed", AT(missed.file), "mean |error| over mean |power| there")
        .number_or_null("corrected_missed", AT(missed.corrected), "with the effects found")
        .number_or_null("regression_missed", AT(missed.regression), "of a linear regression")
        .number_or_null("lead_sd", AT(missed.lead_sd),
                        "standard error of corrected_missed - regression_missed")
        .value("regression_wins", AT(missed.regression_wins()),
               "the regression predicts better, by more than lead_sd");
const auto test_table =
    described::Table<GapTest>()
        .include(answers::back_test_table(), AT(replayed))
        .object(
            "beside_regression",
            [](const GapTest& t) { return t.beside_regression ? &*t.beside_regression : nullptr; },
            "null: not compared", regression_table);

void print(const GapTest& test, const Json& told, const std::string& unit) {
  print_back_test(told, unit);
  if (!test.beside_regression)
    return fmt::print("not compared with a linear regression: {}\n",
                      describe(test.beside_regression.error()));
  const auto percent = [&](const char* of) {
    return number_of(told["beside_regression"], std::string(of) + "_missed", 1, 100);
  };
  fmt::print(
      "power error in windows with new readings: robot file {} %, corrected {} %, linear regression on the "
      "missions of the diagnosis {} %\n",
      percent("file"), percent("corrected"), percent("regression"));
}

// The diagnosis of logs and its test on other missions.
struct Judged {
  gap::Diagnosis diagnosis;
  std::optional<GapTest> test;
};

Result<Judged> judge_recordings(const GapOptions& options, const telemetry::RecordingSet& recordings,
                                const robot::RobotModel& robot) {
  TRY_ASSIGN(auto diagnosis, with_progress("diagnosing", [&](const gap::Progress& progress) {
               return gap::diagnose(recordings, robot, progress);
             }));
  Judged judged{std::move(diagnosis), std::nullopt};
  if (options.test.empty()) return judged;
  const gap::Offer offer = gap::offer_of(judged.diagnosis);
  // The test does not require that the effects can be adopted.
  const Result<robot::RobotModel> tried =
      offer.effects.empty() ? robot : gap::take(offer, robot, {options.effect, true});
  if (!tried) return tl::unexpected(of_option(tried.error(), "--test"));
  TRY_ASSIGN(judged.test,
             test_on_other_missions(options.test, options.robot_id, recordings.missions, robot, *tried));
  return judged;
}

Result<void> apply(const GapOptions& options, const Judged& judged, const robot::RobotModel& robot) {
  const gap::Offer offer = gap::offer_of(judged.diagnosis);
  const std::string objection = judged.test ? judged.test->objection() : "";
  if (!objection.empty() && !options.force && gap::take(offer, robot, options.choice()))
    return fail(Fault::conflict, "--apply", objection + "; --force writes it anyway");
  return apply_offer(options, offer, robot);
}

Result<Exit> gap_between_groups(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                                const GapOptions& options, const report::ReportOrigin& origin) {
  TRY_ASSIGN(const auto groups, gap::groups_of(recordings, options.compare_by));
  return compare_and_print(
      [&](const gap::Progress& progress) {
        return gap::compare_recordings(recordings, groups, robot, progress);
      },
      robot, options, origin);
}

Result<Exit> gap_of_logs(const GapOptions& options, const robot::RobotModel& robot) {
  const auto read = [&] {
    LogProgress progress("reading", options.logs);
    return telemetry::load_recordings(
        options.logs, options.robot_id.empty() ? robot.robot_id : options.robot_id, progress.observer());
  };
  TRY_ASSIGN(const auto recordings, read());
  const report::ReportOrigin origin = report_origin(options.logs, options.robot_file);
  if (!options.compare_by.empty()) return gap_between_groups(recordings, robot, options, origin);
  TRY_ASSIGN(const auto judged, judge_recordings(options, recordings, robot));
  nlohmann::ordered_json document = gap::diagnosis_to_json(judged.diagnosis);
  const auto test = judged.test ? test_table.document(*judged.test) : nlohmann::ordered_json();
  if (options.json && judged.test) document["back_test"] = test;
  show_diagnosis(options, document);
  if (!options.json && judged.test) print(*judged.test, test, options.unit);
  TRY(write_page(options, document, robot, origin));
  if (!options.apply.empty()) TRY(apply(options, judged, robot));
  return Exit::ok;
}

Result<Exit> run_gap(GapOptions& options) {
  // The argument names the robot of a daemon.
  if (!options.server.empty() && options.robot_id.empty() && options.logs.size() == 1)
    options.robot_id = std::exchange(options.logs, {}).front();
  if (!options.server.empty() && !options.logs.empty()) throw CLI::ExcludesError("--server", "log");
  if (!options.server.empty() && options.robot_id.empty()) throw CLI::RequiredError("--robot-id");
  if (options.logs.empty() && options.runs.empty() && options.server.empty())
    throw CLI::RequiredError("log, --missions or --server");
  if (options.robot_file.empty() && options.server.empty()) throw CLI::RequiredError("--robot");
  for (const auto& [option, file] : {std::pair{"--report", &options.report}, {"--apply", &options.apply}})
    TRY(may_write(option, *file, existing(options.force)));
  if (!options.server.empty()) return gap_from_server(options);
  TRY_ASSIGN(const auto robot, robot::load_robot(options.robot_file));
  return options.runs.empty() ? gap_of_logs(options, robot) : gap_from_missions(options, robot);
}

}  // namespace

void add_gap(CLI::App& program, Exit& exit) {
  using O = GapOptions;
  auto* command = add_command<O>(
      program, exit, "gap",
      "Diagnose the gap between measured power and the robot's model: where it occurs, the effects that "
      "cause it and the unexplained rest",
      run_gap,
      {{"log", &O::logs, "LCM event logs of one robot; with --server, the robot", file_of("lcmlog")},
       {"--missions", &O::runs,
        "instead of logs: CSV tables of runs with only their energies, in the columns below", file_of("csv"),
        Excludes{"log"}},
       {"--robot-model", &O::robot_model,
        "with --missions: diagnose the robot file also if the table contains a model's energies",
        Needs{"--missions"}},
       {"--robot", &O::robot_file, "robot file: the model", file_of("json")},
       {"--robot-id", &O::robot_id, "robot of the logs, if its id differs from that of the robot file",
        named("ROBOT")},
       {"--json", &O::json, "print the diagnosis as JSON"},
       {"--report", &O::report, "write the diagnosis as one HTML page with its maps and plots",
        file_of("html")},
       {"--compare-by", &O::compare_by,
        "instead of one diagnosis, compare groups of missions by: 'prefix', the mission id up to its first "
        "'-'; 'suffix', the mission id from its last '_'; or a label, such as surface for the covariates "
        "surface=...; for runs, a label or 'table'",
        named("LABEL")},
       {"--apply", &O::apply,
        "write the robot file with the effects found, or a corrected one if it belongs to another robot; "
        "rejected, with the reason, if the diagnosis does not support it",
        file_of("json")},
       {"--effect", &O::effect,
        "with --apply or --adopt: which of several indistinguishable effects to adopt", named("EFFECT")},
       {"--test", &O::test,
        "logs of other missions: replay them with and without the effects found, and compare with a linear "
        "regression on the missions of the diagnosis; --apply is refused where they show no improvement or "
        "the regression predicts them better",
        file_of("lcmlog"), Excludes{"--missions"}},
       {"--server", &O::server, "daemon that diagnoses its own history of a robot, instead of logs",
        named("URL"), Excludes{"--missions"}, Excludes{"--robot"}},
       {"--max-missions", &O::max_missions, "with --server: number of missions to diagnose, newest first",
        Needs{"--server"}, between(1, 1000)},
       {"--adopt", &O::adopt, "with --server: adopt the effects found, after the daemon's back-test",
        Needs{"--server"}},
       {"--force", &O::force,
        "adopt or apply in spite of the diagnosis's refusal or a back-test without improvement; overwrite "
        "existing files"},
       unit_row<O>()},
      "joulecast gap amr.lcmlog --robot amr.json\n"
      "joulecast gap amr.lcmlog --robot amr.json --apply amr-adopted.json --json\n"
      "joulecast gap amr.lcmlog --robot amr.json --test fresh.lcmlog\n"
      "joulecast gap amr.lcmlog --robot amr.json --report amr-gap.html --force");
  command->footer(run_columns_help() + "\n\n" + command->get_footer());
}

}  // namespace joulecast::client
