#include <fmt/format.h>

#include <string>
#include <vector>

#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/option.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "history/records.h"

namespace joulecast::client {
namespace {

constexpr auto& state_names = history::names_of<history::MissionState>;

struct MissionsOptions : ServerOptions {
  std::vector<Given> given;
};

void print_page(const Json& page, const std::string& unit) {
  print_missions(member_at(page, "missions"),
                 {{"id", "id", 0},
                  {"robot", "robot_id"},
                  {"mission", "mission_id"},
                  {"state", "state"},
                  time_column("start (UTC)", "start"),
                  {"time s", "energy/duration_s", 2},
                  {"driven m", "energy/distance_m", 2},
                  energy_column("battery", "energy/battery_j", unit),
                  energy_column("modelled", "energy/modelled_j", unit)},
                 "no mission matches");
  if (const Json& next = member_at(page, "next_cursor"); next.is_string())
    fmt::print("more: --cursor {}\n", text_of(next));
}

Result<Exit> run_missions(MissionsOptions& options) {
  return show(options.server, target_of("/v1/missions", query_of(options.given)), renamed_by(options.given),
              options.json, [&](const Json& page) { print_page(page, options.unit); });
}

struct LedgerOptions : ServerOptions {
  std::string mission;
};

void print_ledger(const Json& answer, const std::string& unit) {
  const double whole_j = number_or_nan(member_at(answer, "ledger/battery_j"));
  fmt::print("{} of {} (model version {}): {} {} from the battery\n", text_of(answer["mission_id"]),
             text_of(answer["robot_id"]), text_of(answer["model_version"]), energy_text(whole_j, unit), unit);
  print_ledger_terms(member_at(answer, "ledger/terms_j"), whole_j, unit);
}

Result<Exit> run_ledger(LedgerOptions& options) {
  TRY_ASSIGN(const auto number, mission_number(options.server, options.mission));
  return show(options.server, "/v1/missions/" + number + "/ledger", {{"id", "mission"}}, options.json,
              [&](const Json& answer) { print_ledger(answer, options.unit); });
}

}  // namespace

void add_missions(CLI::App& program, Exit& exit) {
  using O = MissionsOptions;
  add_command<O>(
      program, exit, "missions", "List missions with their energy, newest first", run_missions,
      {server_row<O>(),
       {"robot,--robot-id", Text{"robot_id"}, "only missions of this robot", named("ROBOT")},
       {"--mission-id", Text{"mission_id"}, "only missions with this id", named("ID")},
       {"--state", Text{"state"}, "only missions in this state",
        one_of({std::begin(state_names), std::end(state_names)})},
       {"--incomplete", Text{"incomplete"},
        "true: only missions with unmeasured parts; false: only missions without", one_of({"true", "false"})},
       {"--from", Text{"from_utime_us"}, from_help, time_value()},
       {"--to", Text{"to_utime_us"}, to_help, end_time_value()},
       {"--payload-min", Text{"payload_min_kg"}, "least payload, kg", named("NUMBER")},
       {"--payload-max", Text{"payload_max_kg"}, "greatest payload, kg", named("NUMBER")},
       {"--limit", Text{"limit"}, "greatest number of missions on the page", named("INTEGER")},
       {"--cursor", Text{"cursor"}, "continue where an earlier page ended", named("CURSOR")},
       unit_row<O>(),
       json_row<O>("print the page as the server sends it")},
      "joulecast missions amr --server http://127.0.0.1:8080 --limit 20\n"
      "joulecast missions --server http://127.0.0.1:8080 --from 2026-11-21 --state finished");
}

void add_ledger(CLI::App& program, Exit& exit) {
  using O = LedgerOptions;
  add_command<O>(program, exit, "ledger", "Show a mission's energy by cause", run_ledger,
                 {{"mission", &O::mission, mission_help, named("MISSION"), required},
                  server_row<O>(),
                  unit_row<O>(),
                  json_row<O>()},
                 "joulecast ledger 1 --server http://127.0.0.1:8080");
}

}  // namespace joulecast::client
