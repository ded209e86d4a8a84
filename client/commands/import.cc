#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/commands/parse_time.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/progress.h"
#include "telemetry/csv_import.h"
#include "telemetry/event_log.h"
#include "telemetry/recording.h"

namespace joulecast::client {
namespace {

struct Options {
  std::vector<std::string> tables;
  std::string mapping;
  std::string out;
  std::string start;
  std::string robot_id;
  double pause_s = 60;
  bool json = false;
  bool force = false;
};

struct Imported {
  std::string table;
  telemetry::Import import;
};

// Recordings without a date count from zero; real clocks are later than this.
constexpr std::int64_t year_2000_utime_us = 946'684'800'000'000;

Result<std::vector<Imported>> import_all(const Options& options) {
  const auto mapping_text = read_file(options.mapping);
  if (!mapping_text) return tl::unexpected(mapping_text.error());
  const auto mapping = telemetry::ImportMapping::parse(*mapping_text);
  if (!mapping)
    return tl::unexpected(
        Error{mapping.error().fault,
              options.mapping + (mapping.error().field.empty() ? "" : "#" + mapping.error().field),
              mapping.error().message});
  telemetry::ImportOptions how;
  if (!options.robot_id.empty()) how.robot_id = options.robot_id;
  if (!options.start.empty()) {
    const auto start = parse_time(options.start, "--start");
    if (!start) return tl::unexpected(start.error());
    how.start_utime_us = *start;
  }
  std::vector<Imported> all;
  Progress progress("importing", "tables", options.tables.size());
  for (const std::string& table : options.tables) {
    progress.reach(all.size());
    const auto text = read_file(table);
    if (!text) return tl::unexpected(text.error());
    how.source_name = table;
    auto import = telemetry::import_csv(*text, *mapping, how);
    if (!import) return tl::unexpected(import.error());
    const auto& samples = import->recording.samples;
    if (samples.front().utime_us < year_2000_utime_us)
      return invalid("--start", table + " does not say when it was recorded: give its start");
    if (!all.empty() && samples.front().utime_us <= all.back().import.recording.samples.back().utime_us)
      return invalid(table, "begins before " + all.back().table + " ends; give the tables in order of time");
    if (how.start_utime_us)
      how.start_utime_us = samples.back().utime_us + static_cast<std::int64_t>(options.pause_s * 1e6);
    all.push_back({table, std::move(*import)});
  }
  return all;
}

Result<void> write_log(const Options& options, const std::vector<Imported>& all) {
  auto file = OutputFile::create(options.out, existing(options.force));
  if (!file) return tl::unexpected(file.error());
  auto log = telemetry::EventLogWriter::create(file->written_to());
  if (!log) return tl::unexpected(log.error());
  for (const Imported& one : all) {
    if (auto written = telemetry::write_recording(*log, one.import.recording); !written) return written;
  }
  if (auto closed = log->close(); !closed) return closed;
  return file->commit();
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
  return {{"table", one.table},
          {"robot_id", recording.robot_id},
          {"mission_id", recording.mission_id},
          {"start_utime_us", recording.samples.front().utime_us},
          {"end_utime_us", recording.samples.back().utime_us},
          {"rows", report.rows},
          {"samples", report.samples},
          {"rows_without_motion", report.rows_without_motion},
          {"rows_out_of_time", report.rows_out_of_time},
          {"rows_glitched", report.rows_glitched},
          {"cells_filled", report.cells_filled},
          {"covariates", covariates},
          {"glitches", glitches}};
}

void print_text(const Options& options, const std::vector<Imported>& all) {
  fmt::print("{:<20} {:<32} {:>8} {:>8} {:>9} {:>8} {:>9}\n", "robot", "mission", "time s", "rows", "samples",
             "dropped", "glitches");
  for (const Imported& one : all) {
    const telemetry::Recording& r = one.import.recording;
    const telemetry::ImportReport& report = one.import.report;
    fmt::print("{:<20} {:<32} {:>8.1f} {:>8} {:>9} {:>8} {:>9}\n", r.robot_id, r.mission_id,
               1e-6 * static_cast<double>(r.samples.back().utime_us - r.samples.front().utime_us),
               report.rows, report.samples, report.rows - report.samples, report.glitches.size());
  }
  for (const Imported& one : all) {
    constexpr std::size_t shown = 10;
    const auto& glitches = one.import.report.glitches;
    for (std::size_t k = 0; k < std::min(shown, glitches.size()); ++k)
      fmt::print("{}: line {}: {} reads {}, outside its limits: {}\n", one.table, glitches[k].line,
                 glitches[k].column, glitches[k].value, glitches[k].action);
    if (glitches.size() > shown) fmt::print("{}: {} more\n", one.table, glitches.size() - shown);
  }
  fmt::print("{} missions in {}\n", all.size(), options.out);
}

Exit run(const Options& options) {
  if (const auto may = may_write("--out", options.out, existing(options.force)); !may)
    return report(may.error());
  const auto all = import_all(options);
  if (!all) return report(all.error());
  if (const auto written = write_log(options, *all); !written) return report(written.error());
  if (!options.json) {
    print_text(options, *all);
    return Exit::ok;
  }
  nlohmann::json document{{"log", options.out}, {"recordings", nlohmann::json::array()}};
  for (const Imported& one : *all) document["recordings"].push_back(to_json(one));
  std::puts(document.dump(2).c_str());
  return Exit::ok;
}

}  // namespace

void add_import(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<Options>();
  auto* command = program.add_subcommand("import", "Turn CSV tables of foreign robots into an LCM event log");
  command->add_option("table", options->tables, "CSV files, one mission each, in order of time")->required();
  command->add_option("--mapping", options->mapping, "which column is what (deploy/import)")->required();
  command->add_option("--out", options->out, "LCM event log to write")->required();
  command->add_option(
      "--start", options->start,
      "UTC (2024-07-18T09:10:45Z) or microseconds since 1970 of the first row, for tables without "
      "a date; each further table follows the one before");
  command->add_option("--pause", options->pause_s, "seconds between one table and the next, with --start")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--robot-id", options->robot_id, "instead of the mapping's");
  command->add_flag("--force", options->force, force_help);
  command->add_flag("--json", options->json, "print the report as JSON");
  command->callback([options, &exit] { exit = run(*options); });
}

}  // namespace joulecast::client
