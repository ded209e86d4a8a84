#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "base/output_file.h"
#include "client/commands/accepts.h"
#include "client/commands/parse_time.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/progress.h"

// Tables of a daemon's history as CSV files.
namespace joulecast::client {
namespace {

struct ExportOptions {
  std::string server, out = "-";
  bool force = false;
  std::optional<std::string> robot_id, from, to, points, cell_m;
  std::int64_t mission = 0;
};

constexpr const char* accept_csv = "text/csv, application/problem+json;q=0.5";

// The path and query of the page that follows: <...>; rel="next".
std::string next_of(const std::string& link) {
  const auto open = link.find('<'), close = link.find('>');
  if (open == std::string::npos || close == std::string::npos ||
      link.find("rel=\"next\"") == std::string::npos)
    return {};
  return link.substr(open + 1, close - open - 1);
}

// Every page, with the line of titles once.
Exit write_pages(const ExportOptions& options, std::string target, const Renamed& renamed,
                 std::uint64_t all_rows = 0) {
  std::optional<OutputFile> file;
  if (options.out != "-") {
    auto made = OutputFile::create(options.out, existing(options.force));
    if (!made) return report({made.error().fault, "--out", describe(made.error())});
    file.emplace(std::move(*made));
  }
  Progress progress("exporting", "rows", all_rows);
  std::uint64_t rows = 0;
  for (bool first = true; !target.empty(); first = false) {
    const auto reply = ask(options.server, HttpMethod::get, target, {}, renamed, accept_csv);
    if (!reply) return report(reply.error());
    std::string_view text = reply->body;
    const auto titles = text.find('\n');
    if (!first) text.remove_prefix(titles == std::string_view::npos ? text.size() : titles + 1);
    rows += static_cast<std::uint64_t>(std::count(text.begin(), text.end(), '\n'));
    progress.reach(rows);
    if (!file) {
      print_answer(text);
    } else if (const auto written = file->write(text); !written) {
      return report(written.error());
    }
    target = next_of(reply->link);
  }
  if (file) {
    if (const auto done = file->commit(); !done) return report(done.error());
  }
  return Exit::ok;
}

// Exports the missions of a period that match `query`.
Exit export_period(const ExportOptions& options, const char* path, Query query) {
  query.emplace_back("robot_id", options.robot_id);
  for (const auto& [name, flag, text] : {std::tuple{"from_utime_us", "--from", &options.from},
                                         std::tuple{"to_utime_us", "--to", &options.to}}) {
    if (!*text) continue;
    const auto utime_us = text == &options.to ? parse_end_time(**text, flag) : parse_time(**text, flag);
    if (!utime_us) return report(utime_us.error());
    query.emplace_back(name, std::to_string(*utime_us));
  }
  return write_pages(options, target_of(path, query), {{"robot_id", "--robot-id"}, {"cell_m", "--cell"}});
}

Exit export_of_mission(const ExportOptions& options, const char* what, const Query& query) {
  const std::string path = "/v1/missions/" + std::to_string(options.mission) + "/" + what;
  const Renamed renamed{{"id", "--mission"}, {"points", "--points"}};
  // The number of rows to export, if the export takes long.
  std::uint64_t rows = 0;
  if (std::string_view(what) == "telemetry") {
    const auto mission =
        ask(options.server, HttpMethod::get, "/v1/missions/" + std::to_string(options.mission), {}, renamed);
    if (!mission) return report(mission.error());
    const auto answer = object_of(*mission, options.server);
    if (!answer) return report(answer.error());
    rows = answer->value("samples", std::uint64_t{0});
  }
  return write_pages(options, target_of(path, query), renamed, rows);
}

CLI::App* add(CLI::App& group, const char* name, const char* what, ExportOptions& options) {
  auto* command = group.add_subcommand(name, what);
  add_server(*command, options.server);
  command->add_option("--out", options.out, "CSV file to write, - for standard output")
      ->capture_default_str();
  command->add_flag("--force", options.force, force_help);
  return command;
}

void add_period(CLI::App& command, ExportOptions& options) {
  command.add_option("--robot-id", options.robot_id, "only this robot's");
  command.add_option("--from", options.from,
                     "started at or after: 2024-07-18, 2024-07-18T09:10:45Z or microseconds since 1970");
  command.add_option("--to", options.to, "started before, the same");
}

void add_mission(CLI::App& command, ExportOptions& options) {
  command.add_option("--mission", options.mission, "number of the mission, as joulecast missions lists it")
      ->required()
      ->check(positive());
}

}  // namespace

void add_export(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<ExportOptions>();
  auto* group = program.add_subcommand("export", "Write what a daemon has recorded for other programs: CSV tables, parameters for Open-RMF");
  group->require_subcommand(1);
  auto* missions = add(*group, "missions", "Missions with their energy and ratio, one a line", *options);
  add_period(*missions, *options);
  missions->callback([options, &exit] {
    exit = export_period(*options, "/v1/missions", {{"limit", "1000"}});
  });
  auto* floor = add(*group, "floor", "Energy and gap by squares of the floor, over all missions", *options);
  add_period(*floor, *options);
  floor->add_option("--cell", options->cell_m, "side of a square, m; 1 without it");
  floor->callback([options, &exit] {
    exit = export_period(*options, "/v1/floor-map", {{"limit", "20000"}, {"cell_m", options->cell_m}});
  });
  auto* telemetry =
      add(*group, "telemetry", "Every sample of a mission as received, with all digits", *options);
  add_mission(*telemetry, *options);
  telemetry->callback([options, &exit] {
    exit = export_of_mission(*options, "telemetry", {{"limit", "20000"}});
  });
  auto* trace = add(*group, "trace", "Power, speed, charge and position over a mission", *options);
  add_mission(*trace, *options);
  trace->add_option("--points", options->points, "largest number of intervals");
  trace->callback([options, &exit] {
    exit = export_of_mission(*options, "trace", {{"points", options->points}});
  });
  add_export_rmf(*group, exit);
}

}  // namespace joulecast::client
