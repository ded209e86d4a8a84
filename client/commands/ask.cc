#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <deque>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "answers/json/autonomy_json.h"
#include "answers/json/estimate_json.h"
#include "answers/json/profile_json.h"
#include "base/json_number.h"
#include "base/json_text.h"
#include "base/try.h"
#include "client/commands/accepts.h"
#include "client/commands/examples.h"
#include "client/commands/print_autonomy.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/http_client.h"
#include "client/profile_drawing.h"
#include "robot/robot_file.h"

// The commands profile, estimate and autonomy: answers for one robot, computed here from a robot file or by a
// daemon. Both use the same functions.
namespace joulecast::client {
namespace {

using Json = nlohmann::json;

// A file on its own has no history of versions: it counts as the first.
constexpr std::int64_t file_version = 1;

// A member of the request that a flag gives.
template <class Value>
struct Member {
  std::string flag, name;
  std::optional<Value> value = std::nullopt;
};

struct AskOptions {
  std::string robot_file;
  std::string server;
  std::string robot_id;
  std::string request_file;
  double timeout_s = 60;
  bool json = false;
  std::string plot_file;
  bool force = false;
  std::deque<Member<double>> numbers;  // a deque, since CLI11 stores the addresses of its elements
  std::deque<Member<std::string>> texts;
  std::optional<double> length_m;
  std::optional<std::string> turn;
  std::optional<double> turn_rad;  // its value
};

struct Question {
  const char* name;
  const char* what;
  Result<std::string> (*offline)(const Json& request, const answers::RobotOutlook& robot);
  void (*print)(Json answer);
  const char* example;  // request
  bool fleet = false;   // available also for all robots of a server in one request
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
    TRY_ASSIGN(const auto text, read_file(options.request_file));
    auto parsed = parse_json(text);
    if (!parsed) return invalid(options.request_file, describe(parsed.error()));
    request = std::move(*parsed);
    if (!request.is_object()) return invalid(options.request_file, "is not a JSON object");
  }
  if (options.length_m || options.turn_rad) {
    Json path = Json::array();
    if (options.turn_rad) path.push_back({{"kind", "turn"}, {"angle_rad", *options.turn_rad}});
    if (options.length_m) path.push_back({{"kind", "straight"}, {"length_m", *options.length_m}});
    request["path"] = std::move(path);
  }
  for (const auto& [flag, name, value] : options.numbers)
    if (value) request[name] = *value;
  for (const auto& [flag, name, value] : options.texts)
    if (value) request[name] = *value;
  // Counts are whole numbers in the request.
  if (const auto points = request.find("pareto_points"); points != request.end() && points->is_number_float())
    *points = static_cast<std::int64_t>(points->get<double>());
  return request;
}

// JSON pointer of the common request in a request for the fleet.
constexpr std::string_view fleet_request = "/request";

// Replaces the JSON pointer of a member set by a flag by the flag.
Error in_words_of_the_caller(Error error, const AskOptions& options) {
  const auto rename = [&error](const std::string& pointer, const std::string& flag) {
    if (error.field == pointer || error.field == pointer.substr(1)) error.field = flag;
  };
  if (options.robot_id.empty() && !options.server.empty() && error.field.starts_with(fleet_request))
    error.field.erase(0, fleet_request.size());
  if (!options.robot_id.empty()) rename("/id", "--robot-id");
  if (options.turn_rad) rename("/path/0/angle_rad", "--turn");
  if (options.length_m) rename(options.turn_rad ? "/path/1/length_m" : "/path/0/length_m", "--length");
  for (const auto& [flag, name, value] : options.numbers)
    if (value) rename("/" + name, flag);
  for (const auto& [flag, name, value] : options.texts)
    if (value) rename("/" + name, flag);
  return error;
}

Result<std::string> ask_server(const AskOptions& options, const Question& question, const Json& request) {
  TRY_ASSIGN(const auto server, parse_server_url(options.server));
  const auto timeout = std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * options.timeout_s));
  // All digits, as in an answer from a file. Without a robot id the request is for the whole fleet.
  const bool fleet = options.robot_id.empty();
  const std::string path =
      fleet ? std::string("/v1/") + question.name : "/v1/robots/" + options.robot_id + "/" + question.name;
  const Json body = fleet ? Json{{"request", request}} : request;
  TRY_ASSIGN(auto reply, http_request(server, HttpMethod::post, path + "?digits=17", body.dump(), timeout));
  if (!reply.ok()) return tl::unexpected(error_of(reply));
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
  const Json document = Json::parse(text, nullptr, false);
  if (!document.is_object()) return fail(Fault::corrupt, options.server, "did not answer with a JSON object");
  TRY_ASSIGN(const auto drawing, draw_answer(document));
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

Exit run_ask(const AskOptions& options, const Question& question) {
  const auto request = request_of(options);
  if (!request) return report(request.error());
  const auto text = answer(options, question, *request);
  if (!text) return report(in_words_of_the_caller(text.error(), options));
  if (!options.plot_file.empty()) {
    if (const auto drawn = plot(options, question, *request); !drawn) return report(drawn.error());
  }
  Json document = Json::parse(*text, nullptr, false);
  if (document.is_object()) warn_of_limits(document);
  if (options.json) {
    std::puts(text->c_str());
    return Exit::ok;
  }
  if (!document.is_object())
    return report({Fault::corrupt, options.server, "did not answer with a JSON object"});
  question.print(std::move(document));
  return Exit::ok;
}

void print_head(const Json& a) {
  fmt::print("{} (model version {}): {:.2f} J, {:.2f} s, {:.2f} m, {:.2f} rad turned\n",
             a.value("robot_id", ""), a.value("model_version", 0), number_at(a, "energy_j"),
             number_at(a, "duration_s"), number_at(a, "distance_m"), number_at(a, "turned_rad"));
}

void print_ledger_terms(const Json& ledger) {
  constexpr double shown_j = 0.0005;
  for (const auto& [term, joules] : ledger.items())
    if (joules.is_number() && std::fabs(joules.get<double>()) >= shown_j)
      fmt::print("  {:<20} {:>12.3f} J\n", term, effect_on_sum(term, joules.get<double>()));
}

// Prints the energy cost of a shorter duration and the shortest duration within the limits.
void print_price_of_time(double duration_s, const Json& certificate) {
  const double shortest_s = number_at(certificate, "shortest_time_s"),
               price_w = number_at(certificate, "time_multiplier_w");
  if (duration_s <= shortest_s * (1 + answers::at_the_limit)) {
    fmt::print("no faster time is possible: the robot is at its limits\n");
    return;
  }
  constexpr double least_shown_w = 0.005;
  const std::string least =
      std::isfinite(shortest_s) ? fmt::format("; the robot's limits allow {:.2f} s at best", shortest_s) : "";
  if (!(price_w >= least_shown_w)) {
    fmt::print("this is the cheapest time{}\n", least);
  } else if (duration_s - shortest_s < 1) {
    fmt::print("less time would cost {:.3g} J a second or more{}\n", price_w, least);
  } else {
    fmt::print("a second less would cost {:.3g} J or more{}\n", price_w, least);
  }
}

void print_profile(Json a) {
  print_head(a);
  fmt::print("peak {:.3f} m/s, {:.1f} W; braking {:.2f} J, recovered {:.2f} J\n",
             number_at(a, "peak_speed_m_s"), number_at(a, "peak_power_w"), number_at(a, "braking_j"),
             number_at(a, "recovered_j"));
  const Json& c = a["certificate"];
  fmt::print("{}: at most {:.3g} J above the optimum\n", c.value("method", ""), number_at(c, "gap_j"));
  print_price_of_time(number_at(a, "duration_s"), c);
  for (const auto& [shape, baseline] : a["baselines"].items()) {
    if (baseline.is_null()) continue;
    if (!baseline.value("within_limits", true)) {
      fmt::print("a {} of the same time would break the robot's limits\n", shape);
      continue;
    }
    fmt::print("against a {:<10} {:>10.2f} J, {:.1f} % saved\n", shape, number_at(baseline, "energy_j"),
               1e2 * number_at(baseline, "saving_fraction"));
  }
  if (const double speed = number_at(a, "needed_speed_m_s"); std::isfinite(speed))
    fmt::print("the deadline needs a speed limit of {:.3f} m/s at least\n", speed);
  print_ledger_terms(a["ledger_j"]);
  for (const Json& point : a["pareto"])
    fmt::print("  {:>10.2f} s {:>12.2f} J {:>8.3f} m/s at most\n", number_at(point, "duration_s"),
               number_at(point, "energy_j"), number_at(point, "peak_speed_m_s"));
  const auto series = a.find("profile");
  if (series == a.end()) return;
  const Json &t = (*series)["time_s"], &way = (*series)["distance_m"], &v = (*series)["speed_m_s"],
             &yaw = (*series)["yaw_rate_rad_s"], &power = (*series)["power_w"];
  fmt::print("{:>10} {:>10} {:>10} {:>10} {:>10}\n", "time s", "distance m", "speed m/s", "yaw rad/s",
             "power W");
  constexpr std::size_t rows = 20;
  const std::size_t step = t.size() / rows + 1;
  for (std::size_t k = 0; k < t.size(); k = k + 1 == t.size() ? k + 1 : std::min(k + step, t.size() - 1)) {
    const auto at = [k](const Json& column) {
      return column[k].is_number() ? column[k].get<double>() : std::nan("");
    };
    fmt::print("{:>10.2f} {:>10.3f} {:>10.3f} {:>10.3f} {:>10.2f}\n", at(t), at(way), at(v), at(yaw),
               at(power));
  }
}

void print_estimate(Json a) {
  print_head(a);
  if (const Json& q = a["energy_quantiles_j"]; q.is_object())
    fmt::print("as it usually drives; {:.2f} to {:.2f} J at 5 and 95 %\n", number_at(q, "p05"),
               number_at(q, "p95"));
  if (a["ledger"].is_object()) print_ledger_terms(a["ledger"]["terms_j"]);
}

const Question profile{"profile", "Plan the minimum-energy motion along a path", profile_offline,
                       print_profile, R"({
  "path": [{"kind": "straight", "length_m": 6},
           {"kind": "turn", "angle_rad": 1.5708},
           {"kind": "arc", "radius_m": 1.5, "angle_rad": -0.8}],
  "payload_kg": 5,
  "deadline_s": 40
})"};
constexpr Question estimate{
    "estimate",
    "Compute the energy of a motion: a given one, or a path at minimum energy or as usually driven",
    answers::estimate_answer, print_estimate, R"({
  "path": [{"kind": "straight", "length_m": 6}, {"kind": "dwell", "duration_s": 10}, {"kind": "straight", "length_m": 4}],
  "payload_kg": 5,
  "driving": "usual"
})"};
constexpr Question autonomy{
    "autonomy",
    "Compute a robot's remaining range and time, and whether it can do a list of tasks",
    autonomy_offline,
    [](Json answer) { print_autonomy(answer); },
    R"({
  "state_of_charge": 0.6,
  "tasks": [{"task_id": "fetch", "distance_m": 40, "payload_kg": 2, "dwell_s": 30, "to_charger_m": 45},
            {"task_id": "bring", "distance_m": 60, "to_charger_m": 15}],
  "to_charger_m": 5
})",
    true};

std::pair<CLI::App*, std::shared_ptr<AskOptions>> add(CLI::App& program, Exit& exit,
                                                      const Question& question) {
  auto options = std::make_shared<AskOptions>();
  auto* command = program.add_subcommand(question.name, question.what);
  auto* file =
      command->add_option("--robot", options->robot_file, "robot file: answer here, without a server");
  auto* server =
      command->add_option("--server", options->server, "joulecastd to send the request to, host:port");
  auto* id = command->add_option(
      "--robot-id", options->robot_id,
      question.fleet ? "robot of the server; all of them when not given" : "robot of the server");
  server->excludes(file);
  if (!question.fleet) server->needs(id);
  id->needs(server);
  command->add_option(
      "--request", options->request_file,
      "request as JSON (schemas/*-request.schema.json), - for standard input; flags override it");
  command->add_option("--timeout", options->timeout_s, "seconds to wait for the server")
      ->check(positive())
      ->capture_default_str();
  command->add_flag("--json", options->json, "print the answer as the server sends it");
  add_example(*command, question.example);
  command->callback([options, &question, &exit] {
    if (options->turn) options->turn_rad = radians(*options->turn);
    if (options->robot_file.empty() && options->server.empty())
      throw CLI::RequiredError("--robot (a file) or --server (a daemon's address)");
    const bool drive = !question.fleet, asked = !options->request_file.empty();
    if (drive && !asked && !options->length_m && !options->turn_rad)
      throw CLI::RequiredError("--length, --turn or --request (what to drive)");
    if (!drive && !asked && options->server.empty() && !options->numbers.front().value)
      throw CLI::RequiredError("--charge, which is not in a robot file,");
    exit = run_ask(*options, question);
  });
  return {command, options};
}

void add_numbers(CLI::App& command, AskOptions& options,
                 std::initializer_list<std::array<const char*, 3>> flag_member_help) {
  for (const auto& [flag, member, help] : flag_member_help)
    command.add_option(flag, options.numbers.emplace_back(Member<double>{flag, member}).value, help);
}

void add_driving(CLI::App& command, AskOptions& options, const char* help) {
  command
      .add_option("--driving", options.texts.emplace_back(Member<std::string>{"--driving", "driving"}).value,
                  help)
      ->check(one_of({"usual", "minimum_energy"}));
}

void add_drive_flags(CLI::App& command, AskOptions& options) {
  command.add_option("--plot", options.plot_file,
                     "draw speed, power and energy over time into this SVG, against the baselines");
  command.add_flag("--force", options.force, force_help);
  command
      .add_option("--turn", options.turn,
                  "turn in place by that angle (to the left), before --length: 1.57 (rad) or 90deg")
      ->check([](const std::string& text) {
        const auto angle = radians(text);
        if (!angle) return "must be an angle such as 1.57 (rad) or 90deg, is " + text;
        if (std::isdigit(static_cast<unsigned char>(text.back())) == 0 ||
            std::abs(*angle) <= 2 * std::numbers::pi)
          return std::string();
        return fmt::format("is {} rad, {:.3g} turns: is it {}deg? Radians above one turn are written {}rad",
                           text, std::abs(*angle) / (2 * std::numbers::pi), text, text);
      });
  command.add_option("--length", options.length_m, "length of a straight drive, m");
  add_numbers(
      command, options,
      {{"--payload", "payload_kg", "payload, kg"},
       {"--deadline", "deadline_s", "latest arrival, s after the start"},
       {"--value-of-time", "value_of_time_w", "value of one second, J"},
       {"--start-speed", "start_speed_m_s", "speed at the start, m/s; standing by default"},
       {"--end-speed", "end_speed_m_s", "speed at the end, m/s; standing by default"},
       {"--regeneration", "regeneration", "share of braking power that returns to the battery, 0 to 1"}});
}

}  // namespace

void add_profile(CLI::App& program, Exit& exit) {
  auto [command, options] = add(program, exit, profile);
  add_drive_flags(*command, *options);
  add_numbers(*command, *options,
              {{"--energy-budget", "energy_budget_j", "the fastest motion within so many J"},
               {"--pareto", "pareto_points", "also so many points of the front of energy against time"}});
}

void add_estimate(CLI::App& program, Exit& exit) {
  auto [command, options] = add(program, exit, estimate);
  add_drive_flags(*command, *options);
  add_driving(*command, *options, "by minimum-energy profiles (the default), or as the robot usually drives");
}

void add_autonomy(CLI::App& program, Exit& exit) {
  auto [command, options] = add(program, exit, autonomy);
  add_numbers(
      *command, *options,
      {{"--charge", "state_of_charge", "state of charge instead of the live one, 0 to 1"},
       {"--charge-sd", "state_of_charge_sd", "its standard deviation"},
       {"--reserve", "reserve_fraction", "charge to keep instead of the robot file's, 0 to 1"},
       {"--payload", "payload_kg", "payload now, kg"},
       {"--speed", "speed_m_s", "cruising speed of the plan, m/s, instead of the robot's habit"},
       {"--confidence", "confidence", "confidence of the latest departure to the charger, 0.01 to 0.999"}});
  add_driving(*command, *options, "as the robot usually drives (the default), or by minimum-energy profiles");
  command
      ->add_option("--dialect",
                   options->texts.emplace_back(Member<std::string>{"--dialect", "dialect"}).value,
                   "answer as another standard's battery message")
      ->check(one_of(
          std::vector<std::string>(std::begin(answers::dialect_names), std::end(answers::dialect_names))));
}

}  // namespace joulecast::client
