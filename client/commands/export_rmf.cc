#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/json_number.h"
#include "base/median.h"
#include "base/text_file.h"
#include "base/try.h"
#include "client/commands/rmf_fit.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/progress.h"

// The energy parameters of an Open-RMF fleet configuration, fitted to a robot's missions.
namespace joulecast::client {
namespace {

struct RmfOptions : ServerOptions {
  std::string config, out = "-";
  int missions = 60;
  bool force = false;
};

// What is written without --config. The charging current stays unknown if the robot was never seen charging.
std::string empty_configuration() {
  std::string text = "rmf_fleet:\n", section;
  for (const RmfPlace& place : rmf_places()) {
    if (section != place.section) text += fmt::format("  {}:\n", place.section);
    section = place.section;
    const std::string unit = *place.unit == '\0' ? "" : std::string(" # ") + place.unit;
    text += fmt::format("    {}: 0{}\n", place.key, unit);
  }
  return text;
}

Result<Json> object_at(const RmfOptions& options, const std::string& target) {
  return ask_object(options.server, target, {{"id", "robot"}});
}

// Calls `take` with each page of an answer.
Result<void> each_page(const RmfOptions& options, const std::string& path, Query query,
                       const std::function<void(const Json&)>& take) {
  for (;;) {
    TRY_ASSIGN(const Json page, object_at(options, target_of(path, query)));
    take(page);
    const Json& next = page["next_cursor"];
    if (next.is_null()) return {};
    std::erase_if(query, [](const auto& parameter) { return parameter.first == "cursor"; });
    query.emplace_back("cursor", text_of(next));
  }
}

void append_numbers(std::vector<double>& column, const Json& values) {
  for (const Json& v : values) column.push_back(number_or_nan(v));
}

Result<RmfTelemetry> telemetry_of(const RmfOptions& options, const std::string& mission) {
  RmfTelemetry telemetry;
  TRY(each_page(options, "/v1/missions/" + mission + "/telemetry", {{"limit", "20000"}},
                [&](const Json& page) {
                  for (const Json& utime_us : page["utime_us"])
                    telemetry.time_s.push_back(static_cast<double>(utime_us.get<std::int64_t>()) * 1e-6);
                  for (const std::size_t side : {0U, 1U})
                    append_numbers(telemetry.wheel_rad_s[side], page["wheel_velocity_rad_s"][side]);
                  append_numbers(telemetry.voltage_v, page["battery_voltage_v"]);
                  append_numbers(telemetry.current_a, page["battery_current_a"]);
                }));
  return telemetry;
}

// The median current of the robot's whole stays at chargers; none if there is no such stay.
Result<std::optional<double>> charging_current_of(const RmfOptions& options) {
  std::vector<double> currents;
  TRY(each_page(
      options, "/v1/event-log", {{"robot_id", options.robot_id}, {"kind", "charged"}, {"limit", "1000"}},
      [&](const Json& page) {
        for (const Json& event : page["events"]) {
          const Json& detail = event["detail"];
          if (!detail.value("complete", false)) continue;
          const double hours =
              (detail["end_utime_us"].get<double>() - detail["start_utime_us"].get<double>()) / 3.6e9;
          if (hours > 0) currents.push_back(detail["charged_ah"].get<double>() / hours);
        }
      }));
  if (currents.empty()) return std::nullopt;
  return upper_median(std::move(currents));
}

Result<RmfFit> fit_of(const RmfOptions& options, const std::optional<RmfParameters>& before) {
  TRY_ASSIGN(const Json robot, object_at(options, robot_target(options.robot_id)));
  const Json& model = robot["model"];
  TRY_ASSIGN(const Json page,
             object_at(options, target_of("/v1/missions", {{"robot_id", options.robot_id},
                                                           {"state", "finished"},
                                                           {"incomplete", "false"},
                                                           {"limit", std::to_string(options.missions)}})));
  std::vector<std::vector<RmfDrive>> missions;
  Progress progress("reading", "missions", page["missions"].size());
  std::uint64_t read = 0;
  for (const Json& mission : page["missions"]) {
    progress.reach(++read);
    if (!mission["contradictions"].empty() || !mission["annulled"].is_null()) continue;
    TRY_ASSIGN(const RmfTelemetry telemetry, telemetry_of(options, mission["id"].dump()));
    missions.push_back(rmf_drives(telemetry, model["kinematics"]["wheel_radius_m"].get<double>(),
                                  model["kinematics"]["half_track_m"].get<double>()));
  }
  TRY_ASSIGN(RmfFit fit, fit_rmf(missions, model["battery"]["capacity_ah"].get<double>(), before));
  TRY_ASSIGN(const std::optional<double> charging, charging_current_of(options));
  if (charging) fit.parameters.charging_current = *charging;
  return fit;
}

std::string error_text(const RmfError& error) {
  return fmt::format("{:.1f} % (mean {})", 100 * error.absolute,
                     without_sign_of_zero(fmt::format("{:+.1f} %", 100 * error.bias)));
}

std::string summary_of(const RmfOptions& options, const RmfFit& fit) {
  std::string text = fmt::format(
      "# Energy of {}: fitted to {} missions. Mean absolute error of a mission's energy on {} others:\n"
      "# {} with these values",
      options.robot_id, fit.fitted, fit.held_out, error_text(fit.error));
  if (fit.error_before) text += fmt::format("; {} before", error_text(*fit.error_before));
  return text +
         fmt::format(
             ";\n# {} if turns were priced by their angle, at {:.3g} J/rad, which RMF's model cannot do.\n",
             error_text(fit.error_with_turns), fit.turn_j_per_rad);
}

Json rmf_json(const RmfError& error) {
  return {{"absolute_relative", error.absolute}, {"bias_relative", error.bias}};
}

Json rmf_json(const RmfOptions& options, const RmfFit& fit) {
  Json document{{"robot_id", options.robot_id},
                {"missions", {{"fitted", fit.fitted}, {"held_out", fit.held_out}}},
                {"error", rmf_json(fit.error)},
                {"error_before", fit.error_before ? rmf_json(*fit.error_before) : Json()},
                {"error_with_turns", rmf_json(fit.error_with_turns)},
                {"turn_j_per_rad", fit.turn_j_per_rad}};
  for (const RmfPlace& place : rmf_places())
    document[place.section][place.key] = json_number(fit.parameters.*place.value);
  return document;
}

std::string configuration_of(const RmfOptions& options, std::string yaml, const RmfFit& fit) {
  std::string text = summary_of(options, fit) + with_rmf_parameters(yaml, fit.parameters);
  if (!options.config.empty() || !std::isnan(fit.parameters.charging_current)) return text;
  constexpr std::string_view unknown = "charging_current: 0 # A";
  return text.replace(text.find(unknown), unknown.size(),
                      "# charging_current: in A; no whole charge was observed");
}

Result<Exit> export_rmf(RmfOptions& options) {
  std::string yaml = empty_configuration();
  std::optional<RmfParameters> before;
  if (!options.config.empty()) {
    TRY_ASSIGN(yaml, read_file(options.config));
    TRY_ASSIGN(before, read_rmf_configuration(yaml));
  }
  TRY_ASSIGN(const RmfFit fit, fit_of(options, before));
  const std::string text =
      options.json ? rmf_json(options, fit).dump(2) + '\n' : configuration_of(options, yaml, fit);
  if (options.out == "-") {
    print_answer(text);
    return Exit::ok;
  }
  TRY(write_text_file(options.out, text, existing(options.force)));
  return Exit::ok;
}

}  // namespace

void add_export_rmf(CLI::App& group, Exit& exit) {
  using O = RmfOptions;
  add_command<O>(
      group, exit, "rmf",
      "Write the battery, mechanical, ambient and tool parameters of an Open-RMF fleet configuration, fitted "
      "to missions",
      export_rmf,
      {server_row<O>(),
       robot_row<O>("robot of the server", required),
       {"--config", &O::config,
        "fleet configuration in YAML: its values are replaced and its error is reported", file_of("yaml")},
       {"--missions", &O::missions, "number of missions to fit to and test on, newest first",
        between(1, 1000)},
       {"--out", &O::out, "file to write, - for standard output", file_of("yaml")},
       json_row<O>(),
       {"--force", &O::force, force_help}},
      "joulecast export rmf amr --server http://127.0.0.1:8080 --out fleet.yaml");
}

}  // namespace joulecast::client
