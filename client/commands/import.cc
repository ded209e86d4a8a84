#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/try.h"
#include "base/utc_time.h"
#include "client/commands/accepts.h"
#include "client/commands/import_sources.h"
#include "client/commands/parse_time.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/progress.h"
#include "telemetry/csv_import.h"
#include "telemetry/event_log.h"
#include "telemetry/recording.h"

namespace joulecast::client {
namespace {

struct ImportOptions {
  std::vector<std::string> tables;
  std::string mapping;
  std::string out;
  std::string start;
  std::string robot_id;
  std::string robot;
  double pause_s = 60;
  bool json = false;
  bool force = false;
};

struct Imported {
  std::string table;
  telemetry::Import import;

  std::int64_t begin_utime_us() const { return import.recording.samples.front().utime_us; }
  std::int64_t end_utime_us() const { return import.recording.samples.back().utime_us; }
};

const std::string& mission_of(const Imported& one) {
  return one.import.recording.mission_id;
}

Result<std::vector<Imported>> import_all(const ImportOptions& options,
                                         const std::vector<ImportSource>& sources) {
  telemetry::ImportOptions how;
  if (!options.robot_id.empty()) how.robot_id = options.robot_id;
  if (!options.start.empty()) {
    TRY_ASSIGN(const auto start, parse_time(options.start, "--start"));
    how.start_utime_us = start;
  }
  how.pause_us = std::llround(1e6 * options.pause_s);
  std::vector<Imported> all;
  Progress progress("importing", "tables", sources.size());
  std::uint64_t done = 0;
  std::optional<telemetry::ImportMapping> mapping;
  std::string mapping_file;
  for (const ImportSource& source : sources) {
    progress.reach(done++);
    if (!mapping || mapping_file != source.mapping) {
      TRY_ASSIGN(auto read, read_mapping(mapping_file = source.mapping));
      mapping = std::move(read);
    }
    auto missions = import_table(source.table, *mapping, how);
    if (!missions) {
      Error error = std::move(missions.error());
      if (error.field.starts_with(source.table)) error.field.replace(0, source.table.size(), source.shown);
      return tl::unexpected(std::move(error));
    }
    for (telemetry::Import& import : *missions) {
      if (import.recording.samples.front().utime_us < telemetry::year_2000_utime_us)
        return invalid("--start", source.shown + " contains no recording time: give its start");
      all.push_back({source.shown, std::move(import)});
    }
    if (how.start_utime_us) how.start_utime_us = all.back().end_utime_us() + how.pause_us;
  }
  // Tables may be given in any order; a robot is on one mission at a time.
  std::ranges::stable_sort(all, {}, &Imported::begin_utime_us);
  for (std::size_t k = 1; k < all.size(); ++k)
    if (all[k].begin_utime_us() <= all[k - 1].end_utime_us())
      return invalid(all[k].table, fmt::format("mission {} begins at {}, before {} of {} ends",
                                               mission_of(all[k]), utc_text(all[k].begin_utime_us()),
                                               mission_of(all[k - 1]), all[k - 1].table));
  // A robot's samples are numbered on from mission to mission.
  std::map<std::string, std::int64_t> next;
  for (Imported& one : all) number_on(one.import.recording, next);
  return all;
}

Result<void> write_log(const ImportOptions& options, const std::vector<Imported>& all) {
  TRY_ASSIGN(auto file, OutputFile::create(options.out, existing(options.force)));
  TRY_ASSIGN(auto log, telemetry::EventLogWriter::create(file.written_to()));
  for (const Imported& one : all) {
    TRY(telemetry::write_recording(log, one.import.recording));
  }
  TRY(log.close());
  return file.commit();
}

nlohmann::json to_json(const Imported& one) {
  const telemetry::Recording& recording = one.import.recording;
  const telemetry::ImportReport& report = one.import.report;
  nlohmann::json glitches = nlohmann::json::array();
  for (const telemetry::Glitch& g : report.glitches)
    glitches.push_back({{"line", g.line}, {"column", g.column}, {"value", g.value}, {"action", g.action}});
  nlohmann::json covariates = nlohmann::json::array();
  for (const signals::CovariateSeries& series : recording.covariates)
    covariates.push_back({{"name", series.name}, {"changes", series.value.size()}});
  nlohmann::json joins = nlohmann::json::array();
  for (const telemetry::JoinReport& join : report.joins)
    joins.push_back({{"table", join.table},
                     {"rows", join.rows},
                     {"rows_unsorted", join.rows_unsorted},
                     {"matched", join.matched},
                     {"beyond_tolerance", join.beyond_tolerance},
                     {"median_lag_s", join.median_lag_s},
                     {"greatest_lag_s", join.greatest_lag_s}});
  return {{"table", one.table},
          {"robot_id", recording.robot_id},
          {"mission_id", recording.mission_id},
          {"start_utime_us", recording.samples.front().utime_us},
          {"end_utime_us", recording.samples.back().utime_us},
          {"rows", report.rows},
          {"samples", report.samples},
          {"samples_added", report.samples_added},
          {"rows_without_motion", report.rows_without_motion},
          {"rows_unsorted", report.rows_unsorted},
          {"rows_out_of_time", report.rows_out_of_time},
          {"rows_outside_mission", report.rows_outside_mission},
          {"cells_filled", report.cells_filled},
          {"covariates", covariates},
          {"joins", joins},
          {"notes", report.notes},
          {"glitches", glitches}};
}

void print_import(const ImportOptions& options, const std::vector<Imported>& all) {
  fmt::print("{:<20} {:<32} {:>8} {:>8} {:>9} {:>8} {:>9}\n", "robot", "mission", "time s", "rows", "samples",
             "dropped", "glitches");
  for (const Imported& one : all) {
    const telemetry::Recording& r = one.import.recording;
    const telemetry::ImportReport& report = one.import.report;
    fmt::print("{:<20} {:<32} {:>8.1f} {:>8} {:>9} {:>8} {:>9}\n", r.robot_id, r.mission_id,
               telemetry::length_s(r), report.rows, report.samples,
               report.rows + report.samples_added - report.samples, report.glitches.size());
  }
  for (const Imported& one : all) {
    constexpr std::size_t shown = 10;
    for (const std::string& note : one.import.report.notes) fmt::print("{}: {}\n", one.table, note);
    if (const std::size_t unsorted = one.import.report.rows_unsorted; unsorted > 0)
      fmt::print("{}: {} rows are not in the order of time: put in order\n", one.table, unsorted);
    if (const std::size_t twice = one.import.report.rows_out_of_time; twice > 0)
      fmt::print("{}: {} rows have the time of another and are left out\n", one.table, twice);
    for (const telemetry::JoinReport& join : one.import.report.joins)
      fmt::print(
          "{} with {}: {} rows, {} matched, {} beyond the tolerance; lag {:.3f} s (median), {:.3f} s "
          "(greatest)\n",
          one.table, join.table, join.rows, join.matched, join.beyond_tolerance, join.median_lag_s,
          join.greatest_lag_s);
    const auto& glitches = one.import.report.glitches;
    for (std::size_t k = 0; k < std::min(shown, glitches.size()); ++k)
      if (glitches[k].line > 0)
        fmt::print("{}: line {}: {} reads {}, outside its limits: {}\n", one.table, glitches[k].line,
                   glitches[k].column, glitches[k].value, glitches[k].action);
      else
        fmt::print("{}: {}: {:.4g}: {}\n", one.table, glitches[k].column, glitches[k].value,
                   glitches[k].action);
    if (glitches.size() > shown) fmt::print("{}: {} more\n", one.table, glitches.size() - shown);
  }
  fmt::print("{} missions in {}\n", all.size(), options.out);
}

Exit run_import(const ImportOptions& options) {
  if (const auto may = may_write("--out", options.out, existing(options.force)); !may)
    return report(may.error());
  std::vector<ImportSource> sources;
  const auto bags = std::ranges::count_if(options.tables, is_bag);
  if (bags > 0 && static_cast<std::size_t>(bags) < options.tables.size())
    return report({Fault::invalid, "table", "bags and tables are imported by separate commands"});
  BagTables converted;  // its files live as long as the import
  if (bags > 0) {
    auto tables = convert_bags({options.tables, options.mapping, options.robot, options.robot_id});
    if (!tables) return report(tables.error());
    converted = std::move(*tables);
    sources = converted.recordings;
  } else if (options.mapping.empty()) {
    return report(
        {Fault::invalid, "--mapping", "is required for tables: which column is what (deploy/import)"});
  } else if (!options.robot.empty()) {
    return report({Fault::invalid, "--robot", "is for bags; the mapping of a table has the robot's id"});
  } else {
    for (const std::string& table : options.tables) sources.push_back({table, table, options.mapping, {}});
  }
  if (!options.json)
    for (const ImportSource& source : sources)
      for (const std::string& line : source.lines) fmt::print("{}: {}\n", source.shown, line);
  const auto all = import_all(options, sources);
  if (!all) return report(all.error());
  if (const auto written = write_log(options, *all); !written) return report(written.error());
  if (!options.json) {
    print_import(options, *all);
    return Exit::ok;
  }
  nlohmann::json document{{"log", options.out}, {"recordings", nlohmann::json::array()}};
  for (const Imported& one : *all) document["recordings"].push_back(to_json(one));
  for (const ImportSource& source : sources)
    if (!source.lines.empty())
      document["sources"].push_back({{"bag", source.shown}, {"topics", source.lines}});
  std::puts(document.dump(2).c_str());
  return Exit::ok;
}

}  // namespace

void add_import(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<ImportOptions>();
  auto* command = program.add_subcommand(
      "import", "Turn ROS bags and CSV tables of foreign robots into an LCM event log");
  command
      ->add_option(
          "table", options->tables,
          "ROS 1 bags, ROS 2 bags (folder, .db3, .mcap), or CSV files; one mission each unless a column "
          "names them")
      ->required();
  command->add_option("--mapping", options->mapping,
                      "which column is what (deploy/import); of bags: topics, joints and signs (import.md)");
  command->add_option("--robot", options->robot,
                      "robot file: the id and the kinematics for bags without wheel speeds");
  command->add_option("--out", options->out, "LCM event log to write")->required();
  command->add_option(
      "--start", options->start,
      "UTC (2024-07-18T09:10:45Z) or microseconds since 1970 of the first row, for tables without "
      "a date; each further table follows the one before, as given");
  command->add_option("--pause", options->pause_s, "seconds between one table and the next, with --start")
      ->check(positive())
      ->capture_default_str();
  command->add_option("--robot-id", options->robot_id, "instead of the mapping's and the robot file's");
  command->add_flag("--force", options->force, force_help);
  command->add_flag("--json", options->json, "print the report as JSON");
  command->callback([options, &exit] { exit = run_import(*options); });
}

}  // namespace joulecast::client
