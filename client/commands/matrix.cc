#include "answers/matrix.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/progress.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

constexpr std::int64_t matrix_file_version = 1;
constexpr std::size_t most_columns = 8;  // of the printed table

// Two tasks that any robot can price: their ways are given, so that no position is needed.
constexpr const char* example = R"({
  "driving": "minimum_energy",
  "tasks": [{"task_id": "fetch", "payload_kg": 2, "empty": {"distances_m": [12]},
             "loaded": {"distances_m": [8, 5], "turns_rad": [1.5708]}, "pickup_dwell_s": 20},
            {"task_id": "patrol", "empty": {}, "loaded": {"distances_m": [30, 30], "turns_rad": [3.1416]}}]
})";

struct MatrixOptions : ServerOptions {
  std::string request_file, driving;
  std::vector<std::string> robot_files;
  double timeout_s = 60;
};

Result<std::string> answer_here(const MatrixOptions& options, Json request) {
  Json ids = Json::array();
  std::map<std::string, std::shared_ptr<const answers::ModelInForce>> models;
  for (const std::string& file : options.robot_files) {
    TRY_ASSIGN(auto robot, robot::load_robot(file));
    TRY_ASSIGN(auto model, answers::model_in_force(std::move(robot), matrix_file_version));
    ids.push_back(model->robot.robot_id);
    models[model->robot.robot_id] = model;
  }
  if (!request.contains("robots")) request["robots"] = std::move(ids);
  TRY_ASSIGN(auto input, answers::read_matrix(request));
  answers::MatrixFleet fleet;
  fleet.model = [&](const std::string& id) -> Result<std::shared_ptr<const answers::ModelInForce>> {
    if (const auto found = models.find(id); found != models.end()) return found->second;
    return fail(Fault::not_found, "robot_id", "no --robot file describes " + id);
  };
  fleet.live = [](const std::string&) { return answers::LiveRobot{}; };
  fleet.outlook = answers::untried;
  planning::CostTableCache tables;
  answers::MatrixText answer(answers::Matrix(std::move(input), fleet, tables));
  std::string out;
  Progress progress("pricing", "robots", options.robot_files.size());
  for (std::uint64_t rows = 0; answer.next(out, {}); ++rows) progress.reach(rows);
  return out;
}

// The energy of a row on a task, and the time and chance.
std::string matrix_cell(const Json& row, std::size_t task, const std::string& unit) {
  const double energy_j = number_or_nan(row["energy_j"][task]);
  if (!std::isfinite(energy_j)) return "-";
  const Json& chance = member_at(row, "success_probability");
  return fmt::format(
      "{} ({:.1f}{})", energy_text(energy_j, unit), number_or_nan(row["duration_s"][task]),
      chance.is_array() ? fmt::format(", {:.0f} %", std::floor(1e2 * chance[task].get<double>())) : "");
}

void print_matrix(const Json& answer, const std::string& unit) {
  const Json& tasks = answer["task_ids"];
  const Json& rows = answer["rows"];
  std::vector<Column> columns{{fmt::format("energy {} (s, chance)", unit), "robot_id"}};
  for (std::size_t t = 0; t < std::min(tasks.size(), most_columns); ++t)
    columns.push_back(
        {text_of(tasks[t]), "", 0, 1, [t, unit](const Json& row) { return matrix_cell(row, t, unit); }});
  print_rows(rows, columns);
  if (tasks.size() > most_columns)
    fmt::print("... and {} tasks more: --json has them all\n", tasks.size() - most_columns);
  for (const Json& row : rows)
    for (const Json& why : row["infeasible"])
      fmt::print("{}: {} of {} tasks: {}\n", text_of(row["robot_id"]), why["task_ids"].size(), tasks.size(),
                 text_of(why["detail"]));
  fmt::print("cheapest robot for each task:\n");
  for (std::size_t t = 0; t < std::min<std::size_t>(tasks.size(), 50); ++t) {
    const Json* best = nullptr;
    for (const Json& row : rows) {
      const Json& energy = row["energy_j"][t];
      if (energy.is_number() && (best == nullptr || energy < (*best)["energy_j"][t])) best = &row;
    }
    fmt::print("  {:<20} {}\n", text_of(tasks[t]),
               best == nullptr ? "none can do it"
                               : fmt::format("{} {} {}", text_of((*best)["robot_id"]),
                                             energy_text((*best)["energy_j"][t].get<double>(), unit), unit));
  }
}

Result<Json> matrix_request(const MatrixOptions& options) {
  TRY_ASSIGN(auto request, read_json(options.request_file));
  if (!request.is_object()) return invalid(options.request_file, "is not a JSON object");
  if (!options.driving.empty()) request["driving"] = options.driving;
  return request;
}

Result<Exit> run_matrix(MatrixOptions& options) {
  if (options.robot_files.empty() && options.server.empty()) throw CLI::RequiredError("--robot or --server");
  TRY_ASSIGN(const auto request, matrix_request(options));
  std::string text;
  if (options.server.empty()) {
    TRY_ASSIGN(text, answer_here(options, request));
  } else {
    TRY_ASSIGN(auto reply, ask(options.server, HttpMethod::post, "/v1/energy-matrix", request.dump(), {},
                               accept_json, milliseconds_of(options.timeout_s)));
    text = std::move(reply.body);
  }
  if (options.json) {
    std::puts(text.c_str());
    return Exit::ok;
  }
  const Json document = Json::parse(text, nullptr, false);
  if (!document.is_object() || !document.contains("rows") || !document.contains("task_ids"))
    return fail(Fault::corrupt, options.server, "did not answer with an energy matrix");
  print_matrix(document, options.unit);
  return Exit::ok;
}

}  // namespace

void add_matrix(CLI::App& program, Exit& exit) {
  using O = MatrixOptions;
  auto* command = add_command<O>(
      program, exit, "matrix", "Compute the energy of every robot for every task", run_matrix,
      {{"request", &O::request_file,
        "request as JSON, as the service accepts it (openapi.json), - for standard input", file_of("json"),
        required},
       {"--robot", &O::robot_files,
        "robot file, repeatable: compute here, without a server, for all of them if the request lists none",
        file_of("json")},
       {"--driving", &O::driving, "by minimum-energy profiles (the default), or as each robot usually drives",
        one_of({"usual", "minimum_energy"})},
       {"--server", &O::server, server_help, named("URL"), Excludes{"--robot"}},
       {"--timeout", &O::timeout_s, "seconds to wait for the server", positive()},
       unit_row<O>(),
       json_row<O>()},
      "joulecast matrix tasks.json --robot amr.json\n"
      "joulecast matrix --example | joulecast matrix - --robot amr.json");
  add_example(*command, example);
}

}  // namespace joulecast::client
