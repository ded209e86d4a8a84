#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "answers/autonomy.h"
#include "answers/estimate.h"
#include "answers/profile.h"
#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/print.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "report/report.h"
#include "robot/robot_file.h"

// The commands profile, estimate and autonomy: answers for one robot, computed here from a robot file or by a
// daemon. Both use the same functions.
namespace joulecast::client {
namespace {

// A file on its own has no history of versions: it counts as the first.
constexpr std::int64_t file_version = 1;

struct AskOptions : ServerOptions {
  std::string robot_file, request_file, plot_file;
  double timeout_s = 60;
  bool force = false;
  std::vector<Given> given;
  std::optional<double> length_m, turn_rad;
};

struct Question {
  const char* name;
  Result<std::string> (*offline)(const Json& request, const answers::RobotOutlook& robot);
  void (*print)(const Json& answer, const std::string& unit);
};

Result<std::string> profile_offline(const Json& request, const answers::RobotOutlook& robot) {
  return answers::profile_answer(request, *robot.model);
}

Result<std::string> autonomy_offline(const Json& request, const answers::RobotOutlook& robot) {
  planning::CostTableCache tables;
  return answers::autonomy_answer(request, robot, {}, tables);
}

// The request file with the flags' members put over it.
Result<Json> request_of(const AskOptions& options) {
  Json request = Json::object();
  if (!options.request_file.empty()) {
    TRY_ASSIGN(request, read_json(options.request_file));
    if (!request.is_object()) return invalid(options.request_file, "is not a JSON object");
  }
  if (options.length_m || options.turn_rad) {
    Json path = Json::array();
    if (options.turn_rad) path.push_back({{"kind", "turn"}, {"angle_rad", *options.turn_rad}});
    if (options.length_m) path.push_back({{"kind", "straight"}, {"length_m", *options.length_m}});
    request["path"] = std::move(path);
  }
  for (const Given& each : options.given) request[each.member] = each.value;
  // Counts are whole numbers in the request.
  if (const auto points = request.find("pareto_points"); points != request.end() && points->is_number_float())
    *points = static_cast<std::int64_t>(points->get<double>());
  return request;
}

// JSON pointer of the common request in a request for the fleet.
constexpr std::string_view fleet_request = "/request";

// Replaces the JSON pointer of a member set by a flag by the flag.
Error with_flags(Error error, const AskOptions& options) {
  const auto rename = [&error](const std::string& pointer, const std::string& flag) {
    if (error.field == pointer || error.field == pointer.substr(1)) error.field = flag;
  };
  if (options.robot_id.empty() && !options.server.empty() && error.field.starts_with(fleet_request))
    error.field.erase(0, fleet_request.size());
  if (!options.robot_id.empty()) rename("/id", "--robot-id");
  if (options.turn_rad) rename("/path/0/angle_rad", "--turn");
  if (options.length_m) rename(options.turn_rad ? "/path/1/length_m" : "/path/0/length_m", "--length");
  for (const Given& each : options.given) rename("/" + each.member, each.flag);
  rename("/state_of_charge", "--charge");  // unknown to a daemon
  return error;
}

Result<std::string> ask_server(const AskOptions& options, const Question& question, const Json& request) {
  // All digits, as in an answer from a file. Without a robot id the request is for the whole fleet.
  const bool fleet = options.robot_id.empty();
  const std::string part = std::string("/").append(question.name).append("?digits=17"),
                    target = fleet ? "/v1" + part : robot_target(options.robot_id, part);
  const Json body = fleet ? Json{{"request", request}} : request;
  TRY_ASSIGN(auto reply, ask(options.server, HttpMethod::post, target, body.dump(), {}, accept_json,
                             milliseconds_of(options.timeout_s)));
  return std::move(reply.body);
}

Result<std::string> answer(const AskOptions& options, const Question& question, const Json& request) {
  if (!options.server.empty()) return ask_server(options, question, request);
  TRY_ASSIGN(auto robot, robot::load_robot(options.robot_file));
  TRY_ASSIGN(const auto model, answers::model_in_force(std::move(robot), file_version));
  return question.offline(request, answers::untried(model));
}

extern const Question profile;

// Draws the requested motion; for a path, the plan and its baselines.
Result<void> plot(const AskOptions& options, const Question& question, Json request) {
  request["columns"] = true;
  const bool given = request.contains("profile");
  if (!given) request["baseline_columns"] = true;
  TRY_ASSIGN(const auto text, answer(options, given ? question : profile, request));
  TRY_ASSIGN(const auto document, object_of(text, options.server));
  TRY_ASSIGN(const auto drawing, report::draw_answer(document));
  return write_text_file(options.plot_file, drawing, existing(options.force));
}

// "1.57", "1.57rad" or "90deg".
std::optional<double> radians(std::string_view text) {
  double angle = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), angle);
  if (fault != std::errc()) return std::nullopt;
  const std::string_view unit = text.substr(static_cast<std::size_t>(end - text.data()));
  if (unit == "deg") return angle * std::numbers::pi / 180;
  return unit.empty() || unit == "rad" ? std::optional(angle) : std::nullopt;
}

// Warns on standard error if the motion exceeds the robot's limits; its estimate is printed all the same.
void warn_of_limits(const Json& answer) {
  static const std::map<std::string, const char*> units{{"speed", "m/s"},      {"acceleration", "m/s^2"},
                                                        {"yaw_rate", "rad/s"}, {"wheel_speed", "rad/s"},
                                                        {"current", "A"},      {"voltage", "V"}};
  const auto broken = answer.find("beyond_limits");
  if (broken == answer.end()) return;
  for (const Json& limit : *broken) {
    const std::string name = limit.value("limit", "");
    const auto unit = units.find(name);
    fmt::print(stderr,
               "joulecast: warning: the robot cannot drive this: {} reaches {:.4g} {}, its limit is {:.4g}\n",
               name, number_at(limit, "reached"), unit == units.end() ? "" : unit->second,
               number_at(limit, "allowed"));
  }
}

Result<Exit> run_ask(const AskOptions& options, const Question& question) {
  if (options.robot_file.empty() && options.server.empty())
    throw CLI::RequiredError("--robot (a file) or --server (a daemon's address)");
  TRY_ASSIGN(const auto request, request_of(options));
  TRY_ASSIGN(const auto text, answer(options, question, request).map_error([&](Error error) {
    return with_flags(std::move(error), options);
  }));
  if (!options.plot_file.empty()) TRY(plot(options, question, request));
  const auto document = object_of(text, options.server);
  if (document) warn_of_limits(*document);
  if (options.json) {
    std::puts(text.c_str());
    return Exit::ok;
  }
  if (!document) return tl::unexpected(document.error());
  question.print(*document, options.unit);
  return Exit::ok;
}

void print_head(const Json& a, const std::string& unit) {
  fmt::print("{} (model version {}): {} {}, {:.2f} s, {:.2f} m, {:.2f} rad turned\n", a.value("robot_id", ""),
             a.value("model_version", 0), energy_text(number_at(a, "energy_j"), unit), unit,
             number_at(a, "duration_s"), number_at(a, "distance_m"), number_at(a, "turned_rad"));
}

// Prints the energy cost of a shorter duration and the shortest duration within the limits.
void print_price_of_time(double duration_s, const Json& certificate, const std::string& unit) {
  const double shortest_s = number_at(certificate, "shortest_time_s"),
               price_w = number_at(certificate, "time_multiplier_w");
  if (duration_s <= shortest_s * (1 + answers::at_the_limit)) {
    fmt::print("no shorter time is possible: the robot is at its limits\n");
    return;
  }
  constexpr double least_shown_w = 0.005;
  const std::string least =
      std::isfinite(shortest_s) ? fmt::format("; the robot's limits allow {:.2f} s at best", shortest_s) : "";
  if (!(price_w >= least_shown_w)) {
    fmt::print("this duration needs the least energy{}\n", least);
  } else if (duration_s - shortest_s < 1) {
    fmt::print("less time would cost at least {:.3g} {} per second{}\n", in_unit(price_w, unit), unit, least);
  } else {
    fmt::print("one second less would cost at least {:.3g} {}{}\n", in_unit(price_w, unit), unit, least);
  }
}

void print_profile(const Json& a, const std::string& unit) {
  print_head(a, unit);
  fmt::print("peak {:.3f} m/s, {:.1f} W; braking {} {}, of which {} {} recovered\n",
             number_at(a, "peak_speed_m_s"), number_at(a, "peak_power_w"),
             energy_text(number_at(a, "braking_j"), unit), unit,
             energy_text(number_at(a, "recovered_j"), unit), unit);
  const Json& c = member_at(a, "certificate");
  fmt::print("at most {:.3g} {} above the optimum (method: {})\n", in_unit(number_at(c, "gap_j"), unit), unit,
             text_of(member_at(c, "method")));
  print_price_of_time(number_at(a, "duration_s"), c, unit);
  for (const auto& [shape, baseline] : member_at(a, "baselines").items()) {
    if (baseline.is_null()) continue;
    if (!baseline.value("within_limits", true)) {
      fmt::print("a {} of the same duration would exceed the robot's limits\n", shape);
      continue;
    }
    fmt::print("against a {:<10} {:>10} {}, {:.1f} % saved\n", shape,
               energy_text(number_at(baseline, "energy_j"), unit), unit,
               1e2 * number_at(baseline, "saving_fraction"));
  }
  if (const double speed = number_at(a, "needed_speed_m_s"); std::isfinite(speed))
    fmt::print("the deadline needs a speed limit of {:.3f} m/s at least\n", speed);
  print_ledger_terms(member_at(a, "ledger_j"), 0, unit);
  if (const Json& points = member_at(a, "pareto"); !points.empty())
    print_rows(points, {{"time s", "duration_s", 2},
                        energy_column("energy", "energy_j", unit),
                        {"peak m/s", "peak_speed_m_s", 3}});
  const Json& series = member_at(a, "profile");
  if (!series.is_object()) return;
  Json shown = Json::array();
  constexpr std::size_t rows = 20;
  const std::size_t size = series["time_s"].size(), step = size / rows + 1;
  for (std::size_t k = 0; k < size; k = k + 1 == size ? size : std::min(k + step, size - 1)) {
    Json& row = shown.emplace_back(Json::object());
    for (const auto& [name, column] : series.items())
      if (column.is_array() && k < column.size()) row[name] = column[k];
  }
  print_rows(shown, {{"time s", "time_s", 2},
                     {"distance m", "distance_m", 3},
                     {"speed m/s", "speed_m_s", 3},
                     {"yaw rad/s", "yaw_rate_rad_s", 3},
                     {"power W", "power_w", 2}});
}

void print_estimate(const Json& a, const std::string& unit) {
  print_head(a, unit);
  if (const Json& q = member_at(a, "energy_quantiles_j"); q.is_object())
    fmt::print("as it usually drives; {} to {} {} at 5 and 95 %\n", energy_text(number_at(q, "p05"), unit),
               energy_text(number_at(q, "p95"), unit), unit);
  if (const Json& terms = member_at(a, "ledger/terms_j"); terms.is_object())
    print_ledger_terms(terms, 0, unit);
}

const Question profile{"profile", profile_offline, print_profile};
constexpr Question estimate{"estimate", answers::estimate_answer, print_estimate};
constexpr Question autonomy{"autonomy", autonomy_offline, print_autonomy};

template <const Question& question>
Result<Exit> run_drive_question(AskOptions& options) {
  if (options.request_file.empty() && !options.length_m && !options.turn_rad)
    throw CLI::RequiredError("--length, --turn or --request (what to drive)");
  return run_ask(options, question);
}

Result<Exit> run_autonomy(AskOptions& options) {
  const bool charged =
      std::ranges::find(options.given, "state_of_charge", &Given::member) != options.given.end();
  if (options.request_file.empty() && options.server.empty() && !options.robot_file.empty() && !charged)
    throw CLI::RequiredError("with --robot, --charge");
  return run_ask(options, autonomy);
}

// An angle, which becomes radians.
Value angle_value() {
  const auto check = [](std::string& text) -> std::string {
    const auto angle = radians(text);
    if (!angle) return "must be an angle such as 1.57 (rad) or 90deg, is " + text;
    const double turns = std::abs(*angle) / (2 * std::numbers::pi);
    if (std::isdigit(static_cast<unsigned char>(text.back())) != 0 && turns > 1)
      return fmt::format("is {} rad, {:.3g} turns: is it {}deg? Radians above one turn are written {}rad",
                         text, turns, text, text);
    text = fmt::format("{:.17g}", *angle);
    return {};
  };
  return {.name = "ANGLE", .check = {check, ""}};
}

using Rows = std::vector<Row<AskOptions>>;

Rows with(Rows rows, const Rows& more) {
  rows.insert(rows.end(), more.begin(), more.end());
  return rows;
}

Row<AskOptions> driving_row(const char* help) {
  return {"--driving", Text{"driving"}, help, one_of({"usual", "minimum_energy"})};
}

Rows common_rows(const char* robot_help) {
  using O = AskOptions;
  return {
      {"--robot", &O::robot_file, "robot file: compute here, without a server", file_of("json")},
      {"--server", &O::server, server_help, named("URL"), Excludes{"--robot"}},
      robot_row<O>(robot_help, Needs{"--server"}),
      {"--request", &O::request_file,
       "request as JSON, as the service accepts it (openapi.json), - for standard input; flags override it",
       file_of("json")},
      {"--timeout", &O::timeout_s, "seconds to wait for the server", positive()},
      unit_row<O>(),
      json_row<O>()};
}

Rows drive_rows() {
  using O = AskOptions;
  return with(
      common_rows("robot of the server"),
      {{"--plot", &O::plot_file,
        "draw speed, power and energy over time into this SVG, against the baselines", file_of("svg")},
       {"--force", &O::force, force_help},
       {"--turn", &O::turn_rad,
        "turn in place by this angle (to the left), before --length: 1.57 (rad) or 90deg", angle_value()},
       {"--length", &O::length_m, "length of a straight drive, m"},
       {"--payload", Number{"payload_kg"}, "payload, kg"},
       {"--deadline", Number{"deadline_s"}, "latest arrival, s after the start"},
       {"--value-of-time", Number{"value_of_time_w"}, "value of one second, J"},
       {"--start-speed", Number{"start_speed_m_s"}, "speed at the start, m/s; standing by default"},
       {"--end-speed", Number{"end_speed_m_s"}, "speed at the end, m/s; standing by default"},
       {"--regeneration", Number{"regeneration"},
        "fraction of the braking power that returns to the battery, 0 to 1"}});
}

// A request to one robot of a server names it.
void need_robot(CLI::App& command) {
  command.get_option("--server")->needs(command.get_option("--robot-id"));
}

}  // namespace

void add_profile(CLI::App& program, Exit& exit) {
  auto* command = add_command<AskOptions>(
      program, exit, "profile", "Plan the minimum-energy motion along a path", run_drive_question<profile>,
      with(
          drive_rows(),
          {{"--energy-budget", Number{"energy_budget_j"}, "plan the fastest motion within this energy, J"},
           {"--pareto", Number{"pareto_points"}, "number of points on the Pareto front of energy and time"}}),
      "joulecast profile --robot amr.json --length 10 --payload 20\n"
      "joulecast profile --robot amr.json --length 10 --deadline 14 --json\n"
      "joulecast profile amr --server http://127.0.0.1:8080 --turn 90deg --length 10 --pareto 5");
  need_robot(*command);
  add_example(*command, R"({
  "path": [{"kind": "straight", "length_m": 6},
           {"kind": "turn", "angle_rad": 1.5708},
           {"kind": "arc", "radius_m": 1.5, "angle_rad": -0.8}],
  "payload_kg": 5,
  "deadline_s": 40
})");
}

void add_estimate(CLI::App& program, Exit& exit) {
  auto* command = add_command<AskOptions>(
      program, exit, "estimate",
      "Compute the energy of a motion: a given one, or a path at minimum energy or as usually driven",
      run_drive_question<estimate>,
      with(drive_rows(),
           {driving_row("by minimum-energy profiles (the default), or as the robot usually drives")}),
      "joulecast estimate --robot amr.json --length 10 --payload 20\n"
      "joulecast estimate --example | joulecast estimate --robot amr.json --request -");
  need_robot(*command);
  add_example(*command, R"({
  "path": [{"kind": "straight", "length_m": 6}, {"kind": "dwell", "duration_s": 10}, {"kind": "straight", "length_m": 4}],
  "payload_kg": 5,
  "driving": "usual"
})");
}

void add_autonomy(CLI::App& program, Exit& exit) {
  auto* command = add_command<AskOptions>(
      program, exit, "autonomy",
      "Compute a robot's remaining range and time, and whether it can do a list of tasks", run_autonomy,
      with(common_rows("robot of the server; default: all"),
           {{"--charge", Number{"state_of_charge"}, "state of charge instead of the live one, 0 to 1"},
            {"--charge-sd", Number{"state_of_charge_sd"}, "its standard deviation"},
            {"--reserve", Number{"reserve_fraction"}, "charge to keep instead of the robot file's, 0 to 1"},
            {"--payload", Number{"payload_kg"}, "payload now, kg"},
            {"--speed", Number{"speed_m_s"}, "cruising speed, m/s, instead of the robot's usual one"},
            {"--confidence", Number{"confidence"},
             "confidence of the latest departure to the charger, 0.01 to 0.999"},
            driving_row("as the robot usually drives (the default), or by minimum-energy profiles"),
            {"--dialect", Text{"dialect"}, "answer as another standard's battery message",
             one_of({std::begin(answers::dialect_names), std::end(answers::dialect_names)})}}),
      "joulecast autonomy --robot amr.json --charge 0.6 --payload 20\n"
      "joulecast autonomy --robot amr.json --charge 0.6 --dialect vda5050-3.0\n"
      "joulecast autonomy amr --server http://127.0.0.1:8080");
  add_example(*command, R"({
  "state_of_charge": 0.6,
  "tasks": [{"task_id": "fetch", "distances_m": [40], "payload_kg": 2, "dwell_s": 30, "to_charger_m": 45},
            {"task_id": "bring", "distances_m": [60], "to_charger_m": 15}],
  "to_charger_m": 5
})");
}

}  // namespace joulecast::client
