#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/commands/option.h"
#include "tests/study/study_commands.h"
#include "tests/study/thesis/tables.h"

namespace joulecast::client {
namespace {

using nlohmann::json;

struct ThesisCommandOptions {
  std::string table;
  std::string figure;
  bool csv = false;
  bool json = false;
};

void print(const thesis::Table& table) {
  std::printf("Table %s. %s\n  %s.\n\n", table.id.c_str(), table.title.c_str(), table.assumptions.c_str());
  std::printf("  %-42s %10s %10s %8s\n", "", "printed J", "ours J", "differs");
  std::string last_remark;
  for (const thesis::Row& row : table.rows) {
    std::printf("  %-42s %10.2f ", row.what.c_str(), row.printed_j);
    if (row.ours_j)
      std::printf("%10.2f %+6.1f %%\n", *row.ours_j, 100 * *row.difference());
    else
      std::printf("%10s %8s\n", "-", "-");
    if (row.remark != last_remark) std::printf("      %s\n", row.remark.c_str());
    last_remark = row.remark;
  }
  std::printf("\n");
}

json to_json(const thesis::Table& table) {
  json rows = json::array();
  for (const thesis::Row& row : table.rows) {
    const auto difference = row.difference();
    rows.push_back({{"what", row.what},
                    {"printed_j", row.printed_j},
                    {"ours_j", row.ours_j ? json(*row.ours_j) : json()},
                    {"difference", difference ? json(*difference) : json()},
                    {"remark", row.remark}});
  }
  return {{"table", table.id}, {"title", table.title}, {"assumptions", table.assumptions}, {"rows", rows}};
}

void print_csv(const std::vector<thesis::Curve>& curves) {
  std::printf("curve,time_s,speed_m_s\n");
  for (const thesis::Curve& curve : curves)
    for (std::size_t k = 0; k < curve.time_s.size(); ++k)
      std::printf("\"%s\",%.9g,%.9g\n", curve.label.c_str(), curve.time_s[k], curve.speed_m_s[k]);
}

json to_json(const std::vector<thesis::Curve>& curves) {
  json out = json::array();
  for (const thesis::Curve& curve : curves)
    out.push_back({{"label", curve.label}, {"time_s", curve.time_s}, {"speed_m_s", curve.speed_m_s}});
  return out;
}

Exit run(const ThesisCommandOptions& options) {
  const auto robots = thesis::shipped_robots();
  if (!robots) return report(robots.error());
  if (!options.figure.empty()) {
    const auto curves = thesis::figure(robots->nomad, options.figure);
    if (!curves) return report(curves.error());
    if (options.json)
      std::printf("%s\n", to_json(*curves).dump().c_str());
    else
      print_csv(*curves);
    return Exit::ok;
  }
  json all = json::array();
  bool found = false;
  for (const thesis::Table& table : thesis::all_tables(*robots)) {
    if (!options.table.empty() && table.id.find(options.table) == std::string::npos) continue;
    found = true;
    if (options.json)
      all.push_back(to_json(table));
    else
      print(table);
  }
  if (!found) {
    std::string ids;
    for (const thesis::Table& table : thesis::all_tables(*robots))
      ids += (ids.empty() ? "" : ", ") + table.id;
    return report({Fault::invalid, "--table", "is \"" + options.table + "\"; there are " + ids});
  }
  if (options.json) std::printf("%s\n", all.dump(2).c_str());
  return Exit::ok;
}

}  // namespace

void add_thesis(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<ThesisCommandOptions>();
  auto* command = program.add_subcommand(
      "thesis", "Compare the thesis's tables with computed values and explain the differences");
  auto* table = command->add_option("--table", options->table, "only this one, e.g. 4-1")->type_name("ID");
  auto* figure = add_option(*command, "--figure", options->figure, "data of this figure",
                            one_of({"4-2a", "4-2b", "4-2c", "4-2d"}));
  figure->excludes(table);
  auto* csv =
      command->add_flag("--csv", options->csv, "the figure as CSV, which it is unless --json is given");
  csv->needs(figure);
  command->add_flag("--json", options->json, "print JSON")->excludes(csv);
  command->callback([options, &exit] { exit = run(*options); });
}

}  // namespace joulecast::client
