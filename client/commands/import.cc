#include "client/commands/import.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <boost/core/noncopyable.hpp>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <system_error>
#include <utility>

#include "base/json_number.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "client/commands/option.h"
#include "client/commands/print.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/progress.h"
#include "telemetry/event_log.h"
#include "telemetry/recording.h"

namespace joulecast::telemetry {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Glitch, line, column, value, action)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(JoinReport, table, rows, matched, beyond_tolerance, median_lag_s)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ImportReport, rows, samples, samples_added, rows_without_motion,
                                   rows_unsorted, rows_out_of_time, cells_filled, glitches, joins, notes)

}  // namespace joulecast::telemetry

namespace joulecast::client {
namespace {

namespace fs = std::filesystem;

struct ImportOptions {
  std::vector<std::string> tables;
  std::string mapping, out, robot_id, robot;
  std::optional<std::int64_t> start_utime_us;
  double pause_s = 60;
  bool json = false, force = false;
};

// A table with its mapping.
struct ImportSource {
  std::string shown;               // the table's file, or the first bag of the recording
  std::string table, mapping;      // files
  std::vector<std::string> lines;  // of a bag: each topic found and its use, missing sources, warnings
};

struct Imported : telemetry::Import {
  std::string table;

  std::int64_t begin_utime_us() const { return recording.samples.front().utime_us; }
  std::int64_t end_utime_us() const { return recording.samples.back().utime_us; }
};

constexpr std::size_t max_line_bytes = std::size_t{1} << 20;

tl::unexpected<Error> unavailable(const std::string& what, int number, const char* advice = "") {
  return fail(Fault::unavailable, what, std::generic_category().message(number) + advice);
}

// The converter: next to the program in a build folder, or installed.
Result<fs::path> converter() {
  std::error_code unreadable;
  const fs::path folder = fs::read_symlink("/proc/self/exe", unreadable).parent_path();
  for (const char* place : {"bags.cjs", "../share/joulecast/deploy/import/bags.cjs"})
    if (fs::exists(folder / place, unreadable)) return folder / place;
  return fail(Fault::unavailable, "bags.cjs",
              "the converter of bags is not installed with " + folder.string() + "/joulecast");
}

Result<void> run_node(const fs::path& script, const std::string& request) {
  std::array<std::string, 3> words{"node", script.string(), request};
  std::array<char*, 4> arguments{words[0].data(), words[1].data(), words[2].data(), nullptr};
  pid_t child = 0;
  if (const int failed = posix_spawnp(&child, "node", nullptr, nullptr, arguments.data(), environ))
    return unavailable("node", failed, "; bags are read by Node.js 18 or later: `apt install nodejs`");
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return unavailable("node", errno);
  if (status != 0)
    return fail(Fault::unavailable, "node",
                "failed; bags are read by Node.js 18 or later, see `node --version`");
  return {};
}

// A folder, or by its suffix or first bytes a ROS 1 bag, MCAP or a ROS 2 bag in SQLite.
bool is_bag(const std::string& path) {
  std::error_code unreadable;
  if (fs::is_directory(path, unreadable)) return true;
  const std::string suffix = fs::path(path).extension().string();
  if (suffix == ".bag" || suffix == ".mcap" || suffix == ".db3") return true;
  std::string head(16, ' ');
  std::ifstream(path, std::ios::binary).read(head.data(), std::ssize(head));
  return head.starts_with("#ROSBAG V2.0") || head.starts_with("\x89MCAP0\r\n") ||
         head.starts_with("SQLite format 3");
}

// The recordings of bags as tables in a folder, converted by deploy/import/bags.cjs.
class ConvertedBags : boost::noncopyable {
 public:
  ~ConvertedBags() {
    std::error_code left;
    fs::remove_all(folder_, left);
  }

  Result<std::vector<ImportSource>> convert(const ImportOptions& options) {
    if (mkdtemp(folder_.data()) == nullptr) return unavailable(std::exchange(folder_, {}), errno);
    TRY_ASSIGN(const auto script, converter());
    const Json asked{{"bags", options.tables},
                     {"out", folder_},
                     {"mapping", options.mapping},
                     {"robot", options.robot},
                     {"robot_id", options.robot_id}};
    TRY(run_node(script, asked.dump()));
    TRY_ASSIGN(const auto text, read_file(folder_ + "/answer.json"));
    const Json answer = Json::parse(text);
    if (answer.contains("message")) return invalid(answer.at("field"), answer.at("message"));
    std::vector<ImportSource> sources;
    for (const Json& one : answer.at("recordings"))
      sources.push_back({one.at("source"), folder_ + "/" + one.at("table").get<std::string>(),
                         folder_ + "/" + one.at("mapping").get<std::string>(), one.at("lines")});
    return sources;
  }

 private:
  std::string folder_ = (fs::temp_directory_path() / "joulecast-import-XXXXXX").string();
};

using Mappings = std::map<std::string, telemetry::ImportMapping>;  // by path

Result<std::vector<Imported>> import_all(const ImportOptions& options,
                                         const std::vector<ImportSource>& sources, const Mappings& mappings) {
  telemetry::ImportOptions how;
  if (!options.robot_id.empty()) how.robot_id = options.robot_id;
  how.start_utime_us = options.start_utime_us;
  how.pause_us = std::llround(1e6 * options.pause_s);
  std::vector<Imported> all;
  Progress progress("importing", "tables", sources.size());
  std::uint64_t done = 0;
  for (const ImportSource& source : sources) {
    progress.reach(done++);
    auto missions = import_table(source.table, mappings.at(source.mapping), how);
    if (!missions) {
      Error error = std::move(missions.error());
      if (error.field.starts_with(source.table)) error.field.replace(0, source.table.size(), source.shown);
      return tl::unexpected(std::move(error));
    }
    for (telemetry::Import& import : *missions) {
      all.push_back({std::move(import), source.shown});
      if (all.back().begin_utime_us() < telemetry::year_2000_utime_us)
        return invalid("--start", source.shown +
                                      " begins before 2000: give the time of its first row, or correct the "
                                      "unit of its times");
    }
    if (how.start_utime_us) how.start_utime_us = all.back().end_utime_us() + how.pause_us;
  }
  // Tables may be given in any order; a robot is on one mission at a time.
  std::ranges::stable_sort(all, {}, &Imported::begin_utime_us);
  for (std::size_t k = 1; k < all.size(); ++k)
    if (all[k].begin_utime_us() <= all[k - 1].end_utime_us())
      return invalid(all[k].table, fmt::format("mission {} begins at {}, before {} of {} ends",
                                               all[k].recording.mission_id, utc_text(all[k].begin_utime_us()),
                                               all[k - 1].recording.mission_id, all[k - 1].table));
  std::map<std::string, std::int64_t> next;
  for (Imported& one : all) number_on(one.recording, next);
  return all;
}

Result<void> write_log(const ImportOptions& options, const std::vector<Imported>& all) {
  TRY_ASSIGN(auto file, OutputFile::create(options.out, existing(options.force)));
  TRY_ASSIGN(auto log, telemetry::EventLogWriter::create(file.written_to()));
  for (const Imported& one : all) TRY(telemetry::write_recording(log, one.recording));
  TRY(log.close());
  return file.commit();
}

Json to_json(const Imported& one) {
  const telemetry::Recording& recording = one.recording;
  Json document = one.report;
  document["covariates"] = Json::array();
  for (const signals::CovariateSeries& series : recording.covariates)
    document["covariates"].push_back({{"name", series.name}, {"changes", series.value.size()}});
  document.update({{"table", one.table},
                   {"robot_id", recording.robot_id},
                   {"mission_id", recording.mission_id},
                   {"start_utime_us", one.begin_utime_us()},
                   {"end_utime_us", one.end_utime_us()},
                   {"length_s", 1e-6 * static_cast<double>(one.end_utime_us() - one.begin_utime_us())},
                   {"rows_dropped", one.report.rows + one.report.samples_added - one.report.samples}});
  return document;
}

void print_import(const ImportOptions& options, const std::vector<Imported>& all, const Json& document) {
  print_rows(document["recordings"],
             {{"robot", "robot_id"},
              {"mission", "mission_id"},
              {"time s", "length_s", 1},
              {"rows", "rows", 0},
              {"samples", "samples", 0},
              {"dropped", "rows_dropped", 0},
              {"glitches", "", 0, 1, [](const Json& r) { return std::to_string(r["glitches"].size()); }}});
  for (const Json& warning : document["warnings"]) fmt::print("{}\n", warning.get<std::string>());
  for (const Imported& one : all) {
    constexpr std::size_t shown = 10;
    const telemetry::ImportReport& report = one.report;
    for (const std::string& note : report.notes) fmt::print("{}: {}\n", one.table, note);
    for (const auto& [count, says] :
         {std::pair(report.rows_without_motion, "rows lack a wheel speed and are skipped"),
          std::pair(report.rows_unsorted, "rows were out of order and are sorted by time"),
          std::pair(report.rows_out_of_time, "rows repeat the time of another row and are skipped")})
      if (count > 0) fmt::print("{}: {} {}\n", one.table, count, says);
    for (const telemetry::JoinReport& join : report.joins)
      fmt::print("{} with {}: {} rows, {} matched, {} beyond the tolerance; lag {:.3f} s (median)\n",
                 one.table, join.table, join.rows, join.matched, join.beyond_tolerance, join.median_lag_s);
    for (const telemetry::Glitch& glitch :
         std::span(report.glitches).first(std::min(shown, report.glitches.size())))
      glitch.line > 0
          ? fmt::print("{}: line {}: {} reads {}, outside its limits: {}\n", one.table, glitch.line,
                       glitch.column, glitch.value, glitch.action)
          : fmt::print("{}: {}: {:.4g}: {}\n", one.table, glitch.column, glitch.value, glitch.action);
    if (report.glitches.size() > shown)
      fmt::print("{}: {} more\n", one.table, report.glitches.size() - shown);
  }
  fmt::print("{} in {}\n", count_of(all.size(), "mission"), options.out);
}

Result<Exit> run_import(ImportOptions& options) {
  TRY(may_write("--out", options.out, existing(options.force)));
  std::vector<ImportSource> sources;
  const auto bags = std::ranges::count_if(options.tables, is_bag);
  if (bags > 0 && static_cast<std::size_t>(bags) < options.tables.size())
    return invalid("recording", "bags and tables are imported by separate commands");
  std::optional<ConvertedBags> converted;
  if (bags > 0) {
    TRY_ASSIGN(sources, converted.emplace().convert(options));
  } else if (options.mapping.empty()) {
    return invalid("--mapping", "is required for tables: it assigns columns to channels (deploy/import)");
  } else if (!options.robot.empty()) {
    return invalid("--robot", "is for bags; the mapping of a table has the robot's id");
  } else {
    for (const std::string& table : options.tables) sources.push_back({table, table, options.mapping, {}});
  }
  if (!options.json)
    for (const ImportSource& source : sources)
      for (const std::string& line : source.lines) fmt::print("{}: {}\n", source.shown, line);
  Mappings mappings;
  for (const ImportSource& source : sources)
    if (!mappings.contains(source.mapping)) {
      TRY_ASSIGN(mappings[source.mapping], read_mapping(source.mapping));
    }
  TRY_ASSIGN(const auto all, import_all(options, sources, mappings));
  TRY(write_log(options, all));
  Json document{{"log", options.out}, {"recordings", Json::array()}, {"warnings", Json::array()}};
  if (bags == 0)
    for (const auto& [field, says] : telemetry::suspicious(mappings.at(options.mapping)))
      document["warnings"].push_back(options.mapping + "#" + field + " " + says);
  for (const Imported& one : all) document["recordings"].push_back(to_json(one));
  for (const ImportSource& source : sources)
    if (!source.lines.empty())
      document["sources"].push_back({{"bag", source.shown}, {"topics", source.lines}});
  options.json ? print_json(document) : print_import(options, all, document);
  return Exit::ok;
}

}  // namespace

void number_on(telemetry::Recording& recording, std::map<std::string, std::int64_t>& next) {
  for (signals::Sample& sample : recording.samples) sample.sequence = next[recording.robot_id]++;
}

Result<telemetry::ImportMapping> read_mapping(const std::string& path) {
  TRY_ASSIGN(const auto text, read_file(path));
  return telemetry::ImportMapping::parse(text).map_error([&](Error error) {
    error.field = path + (error.field.empty() ? "" : "#" + error.field);
    return error;
  });
}

Result<void> check_bag_mapping(const std::string& path) {
  ImportOptions options;
  options.mapping = path;
  options.robot_id = "any";
  TRY(ConvertedBags().convert(options));
  return {};
}

Result<std::vector<telemetry::Import>> import_table(const std::string& path,
                                                    const telemetry::ImportMapping& mapping,
                                                    telemetry::ImportOptions how) {
  TRY_ASSIGN(const auto text, read_file(path, max_line_bytes));
  how.read_file = [](const std::string& joined) { return read_file(joined, max_line_bytes); };
  how.source_name = path;
  return telemetry::import_missions(text, mapping, how);
}

void add_import(CLI::App& program, Exit& exit) {
  using O = ImportOptions;
  add_command<O>(
      program, exit, "import", "Convert ROS bags and CSV tables into an LCM event log", run_import,
      {{"recording", &O::tables,
        "ROS 1 bags, ROS 2 bags (folder, .db3, .mcap), or CSV tables; one mission each unless a column names "
        "them",
        file_of("csv"), required},
       {"--mapping", &O::mapping,
        "mapping of columns (deploy/import); for bags: topics, joints and signs (import.md)",
        file_of("json")},
       {"--robot", &O::robot, "robot file: the id and the kinematics for bags without wheel speeds",
        file_of("json")},
       {"--out", &O::out, "LCM event log to write", file_of("lcmlog"), required},
       {"--start", &O::start_utime_us,
        "time of the first row of tables without dates, UTC (2024-07-18T09:10:45Z) or microseconds since "
        "1970; further tables follow in the given order",
        time_value()},
       {"--pause", &O::pause_s, "time between two tables with --start, s", positive()},
       {"--robot-id", &O::robot_id, "robot id, instead of the mapping's and the robot file's",
        named("ROBOT")},
       {"--force", &O::force, force_help},
       {"--json", &O::json, "print the report as JSON"}},
      "joulecast import runs.csv --mapping mapping.json --start 2026-03-01T08:00:00Z --out imported.lcmlog");
}

}  // namespace joulecast::client
