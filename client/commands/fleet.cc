#include <fmt/format.h>

#include <string>
#include <vector>

#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/option.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "history/records.h"

// The commands robots and state, missions and ledger: the present state of a daemon's robots, and their
// history.
namespace joulecast::client {
namespace {

// "40 s", "12 min", "5 h", "3 d"; "never" if silent_s is not a number.
std::string age_of(const Json& state) {
  if (!state["silent_s"].is_number()) return "never";
  const double s = state["silent_s"].get<double>();
  if (s < 100) return fmt::format("{:.0f} s", s);
  if (s < 6000) return fmt::format("{:.0f} min", s / 60);
  if (s < 360'000) return fmt::format("{:.0f} h", s / 3600);
  return fmt::format("{:.0f} d", s / 86'400);
}

void print_fleet_table(const Json& page) {
  const auto heard = [](const Json& r) { return r.value("live", false) ? "now" : age_of(r); };
  print_rows(member_at(page, "robots"),
             {{"robot", "robot_id"},
              text_column("heard", heard),
              {"charge %", "state_of_charge", 1, 100},
              {"range km", "range_m", 2, 1e-3},
              {"power W", "measured_power_w", 1},
              {"speed m/s", "speed_m_s", 2},
              {"model", "model_version", 0},
              {"mission", "mission/mission_id"}},
             "no robot has a model or has been heard");
}

void print_state(const Json& s, const std::string& unit) {
  fmt::print("{}: {}, model version {}\n", text_of(s["robot_id"]),
             s.value("live", false) ? "live" : "silent for " + age_of(s), text_of(s["model_version"]));
  const auto line = [](const char* name, const std::string& text) {
    fmt::print("  {:<10} {}\n", name, text);
  };
  line("heard", to_second(s["time"]));
  line("power", fmt::format("{} W measured, {} W modelled", number_of(s, "measured_power_w", 1),
                            number_of(s, "modelled_power_w", 1)));
  line("motion", fmt::format("{} m/s, {} rad/s, payload {} kg", number_of(s, "speed_m_s", 2),
                             number_of(s, "yaw_rate_rad_s", 2), number_of(s, "payload_kg", 1)));
  line("charge",
       fmt::format("{} % (standard deviation {} %), {} V, {} A", number_of(s, "state_of_charge", 1, 100),
                   number_of(s, "state_of_charge_sd", 1, 100), number_of(s, "battery_voltage_v", 2),
                   number_of(s, "battery_current_a", 2)));
  if (const Json& limitation = member_at(s, "charge/limitation"); limitation.is_string())
    line("", text_of(limitation));
  line("range", fmt::format("{} km (at least {} in 19 of 20 cases), {} h", number_of(s, "range_m", 2, 1e-3),
                            number_of(s, "range_quantiles_m/p05", 2, 1e-3),
                            number_of(s, "run_time_s", 1, 1.0 / 3600)));
  if (s["mission"].is_object())
    line("mission",
         fmt::format("{} since {}, {} {}", text_of(s["mission"]["mission_id"]),
                     to_second(s["mission"]["start"]),
                     energy_text(number_or_nan(member_at(s, "mission/energy/battery_j")), unit), unit));
  for (const auto& fault : s["faults"].items()) line("fault", fault_text(s, fault.key()));
  for (const Json& each : s["contradictions"]) line("conflict", text_of(each["says"]));
}

Result<Exit> list_robots(ServerOptions& options) {
  return show(options.server, "/v1/robots", {}, options.json, print_fleet_table);
}

Result<Exit> show_state(ServerOptions& options) {
  return show(options.server, robot_target(options.robot_id, "/state"), {{"id", "--robot-id"}}, options.json,
              [&](const Json& state) { print_state(state, options.unit); });
}

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

void add_robots(CLI::App& program, Exit& exit) {
  using O = ServerOptions;
  add_command<O>(program, exit, "robots", "List the robots of a daemon with their live state", list_robots,
                 {server_row<O>(), json_row<O>()}, "joulecast robots --server http://127.0.0.1:8080");
}

void add_state(CLI::App& program, Exit& exit) {
  using O = ServerOptions;
  add_command<O>(
      program, exit, "state", "Show the live state of a robot", show_state,
      {server_row<O>(), robot_row<O>("robot of the server", required), unit_row<O>(), json_row<O>()},
      "joulecast state amr --server http://127.0.0.1:8080");
}

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
