#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/commands/server_answer.h"
#include "client/commands/table.h"

// The commands robots and state: the present state of a daemon's robots.
namespace joulecast::client {
namespace {

using Json = nlohmann::json;

struct FleetOptions {
  std::string server, robot_id;
  bool json = false;
};

std::string mission_of(const Json& state) {
  return state["mission"].is_object() ? text_of(state["mission"]["mission_id"]) : "-";
}

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
  fmt::print("{:<20} {:<8} {:>9} {:>9} {:>9} {:>9} {:>6}  {}\n", "robot", "heard", "charge %", "range km",
             "power W", "speed m/s", "model", "mission");
  for (const Json& r : page["robots"]) {
    const std::string heard = r.value("live", false) ? "now" : age_of(r);
    fmt::print("{:<20} {:<8} {:>9} {:>9} {:>9} {:>9} {:>6}  {}\n", text_of(r["robot_id"]), heard,
               number_of(r, "state_of_charge", 1, 100), number_of(r, "range_m", 2, 1e-3),
               number_of(r, "measured_power_w", 1), number_of(r, "speed_m_s", 2), text_of(r["model_version"]),
               mission_of(r));
  }
  if (page["robots"].empty()) fmt::print("no robot has a model or has been heard\n");
}

void print_state(const Json& s) {
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
  line("range", fmt::format("{} km ({} in 19 of 20 cases), {} h", number_of(s, "range_m", 2, 1e-3),
                            number_of(s["range_quantiles_m"], "p05", 2, 1e-3),
                            number_of(s, "run_time_s", 1, 1.0 / 3600)));
  if (s["mission"].is_object())
    line("mission",
         fmt::format("{} since {}, {} J", text_of(s["mission"]["mission_id"]),
                     to_second(s["mission"]["start"]), number_of(s["mission"]["energy"], "battery_j", 0)));
  for (const auto& [reason, count] : s["faults"].items()) line("fault", reason + ": " + count.dump());
  for (const Json& each : s["contradictions"]) line("conflict", text_of(each["says"]));
}

Exit run_fleet(const FleetOptions& options, const std::string& target, void (*print)(const Json&)) {
  return show(options.server, target, {{"id", "--robot-id"}}, options.json, print);
}

}  // namespace

void add_robots(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<FleetOptions>();
  auto* command = program.add_subcommand("robots", "List the robots of a daemon with their live state");
  add_server(*command, options->server);
  command->add_flag("--json", options->json, "print the answer as the server sends it");
  command->callback([options, &exit] { exit = run_fleet(*options, "/v1/robots", print_fleet_table); });
}

void add_state(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<FleetOptions>();
  auto* command = program.add_subcommand("state", "Show the live state of a robot");
  add_server(*command, options->server);
  command->add_option("--robot-id", options->robot_id, "robot of the server")->required();
  command->add_flag("--json", options->json, "print the answer as the server sends it");
  command->callback([options, &exit] {
    exit = run_fleet(*options, "/v1/robots/" + percent_encoded(options->robot_id) + "/state", print_state);
  });
}

}  // namespace joulecast::client
