#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/text_file.h"
#include "base/try.h"
#include "client/commands/option.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/progress.h"

// Tables of a daemon's history as CSV files.
namespace joulecast::client {
namespace {

struct ExportOptions {
  std::string server, mission, out = "-";
  bool force = false;
  std::vector<Given> given;
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
Result<Exit> write_pages(const ExportOptions& options, const std::string& path, Query query,
                         const std::string& limit, const Renamed& renamed, std::uint64_t all_rows = 0) {
  std::optional<OutputFile> file;
  if (options.out != "-") {
    auto made = OutputFile::create(options.out, existing(options.force));
    if (!made) return fail(made.error().fault, "--out", describe(made.error()));
    file.emplace(std::move(*made));
  }
  if (!limit.empty()) query.emplace_back("limit", limit);
  std::string target = target_of(path, query);
  Progress progress("exporting", "rows", all_rows);
  std::uint64_t rows = 0;
  for (bool first = true; !target.empty(); first = false) {
    TRY_ASSIGN(const auto reply, ask(options.server, HttpMethod::get, target, {}, renamed, accept_csv));
    std::string_view text = reply.body;
    const auto titles = text.find('\n');
    const std::string_view lines = titles == text.npos ? std::string_view() : text.substr(titles + 1);
    rows += static_cast<std::uint64_t>(std::ranges::count(lines, '\n'));
    if (!first) text = lines;
    progress.reach(rows);
    if (file)
      TRY(file->write(text));
    else
      print_answer(text);
    target = next_of(reply.link);
  }
  if (file) TRY(file->commit());
  if (rows < all_rows)
    fmt::print(stderr,
               "joulecast: the store has {} of the mission's {} samples: store.retention_days and "
               "store.retention_bytes limit recordings\n",
               rows, all_rows);
  return Exit::ok;
}

Result<Exit> export_missions(ExportOptions& options) {
  return write_pages(options, "/v1/missions", query_of(options.given), "1000", renamed_by(options.given));
}

Result<Exit> export_floor(ExportOptions& options) {
  return write_pages(options, "/v1/floor-map", query_of(options.given), "20000", renamed_by(options.given));
}

Result<Exit> export_telemetry(ExportOptions& options) {
  const Renamed renamed{{"id", "mission"}};
  TRY_ASSIGN(const auto number, mission_number(options.server, options.mission));
  // The number of rows to export, which takes long.
  TRY_ASSIGN(const auto mission, ask_object(options.server, "/v1/missions/" + number, renamed));
  return write_pages(options, "/v1/missions/" + number + "/telemetry", {}, "20000", renamed,
                     mission.value("samples", std::uint64_t{0}));
}

Result<Exit> export_trace(ExportOptions& options) {
  Renamed renamed = renamed_by(options.given);
  renamed.emplace_back("id", "mission");
  TRY_ASSIGN(const auto number, mission_number(options.server, options.mission));
  return write_pages(options, "/v1/missions/" + number + "/trace", query_of(options.given), "", renamed);
}

}  // namespace

void add_export(CLI::App& program, Exit& exit) {
  using O = ExportOptions;
  auto& group = add_group(
      program, "export", "Write records of a daemon for other programs: CSV tables, parameters for Open-RMF");
  const Row<O> server = server_row<O>(),
               out{"--out", &O::out, "CSV file to write, - for standard output", file_of("csv")},
               force{"--force", &O::force, force_help},
               robot{"robot,--robot-id", Text{"robot_id"}, "only missions of this robot", named("ROBOT")},
               from{"--from", Text{"from_utime_us"}, from_help, time_value()},
               to{"--to", Text{"to_utime_us"}, to_help, end_time_value()},
               mission{"mission,--mission", &O::mission, mission_help, named("MISSION"), required};
  add_command<O>(
      group, exit, "missions", "Write one line for each mission: its energy and ratio", export_missions,
      {server, robot, from, to, out, force},
      "joulecast export missions --server http://127.0.0.1:8080 --from 2026-11-21 --out missions.csv");
  add_command<O>(
      group, exit, "floor", "Write the energy and gap of each floor square, over all missions", export_floor,
      {server,
       robot,
       from,
       to,
       {"--cell", Text{"cell_m"}, "side of a square, m (default 1)", named("NUMBER")},
       out,
       force},
      "joulecast export floor --server http://127.0.0.1:8080 --from 2026-11-21 --cell 2 --out floor.csv");
  add_command<O>(group, exit, "telemetry", "Write every sample of a mission as received, with all digits",
                 export_telemetry, {server, mission, out, force},
                 "joulecast export telemetry --server http://127.0.0.1:8080 --mission 1 --out samples.csv");
  add_command<O>(group, exit, "trace", "Write power, speed, charge and position over a mission", export_trace,
                 {server,
                  mission,
                  {"--points", Text{"points"}, "greatest number of intervals", named("INTEGER")},
                  out,
                  force},
                 "joulecast export trace 1 --server http://127.0.0.1:8080 --points 500 --out trace.csv");
  add_export_rmf(group, exit);
}

}  // namespace joulecast::client
