#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "answers/json/matrix_json.h"
#include "base/json_text.h"
#include "base/try.h"
#include "client/commands/accepts.h"
#include "client/commands/examples.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/http_client.h"
#include "client/progress.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t matrix_file_version = 1;
constexpr std::size_t most_columns = 8;  // of the printed table

// Two tasks that any robot can price: their ways are given, so that no position is needed.
constexpr const char* example = R"({
  "driving": "minimum_energy",
  "tasks": [{"task_id": "fetch", "payload_kg": 2, "empty": {"distance_m": 12},
             "loaded": {"distances_m": [8, 5], "turns_rad": [1.5708]}, "pickup_dwell_s": 20},
            {"task_id": "patrol", "empty": {"distance_m": 0}, "loaded": {"distances_m": [30, 30], "turns_rad": [3.1416]}}]
})";

struct MatrixOptions {
  std::string request_file;
  std::vector<std::string> robot_files;
  std::string server;
  std::string driving;
  double timeout_s = 60;
  bool json = false;
};

Result<std::string> ask_for_matrix(const MatrixOptions& options, const Json& request) {
  TRY_ASSIGN(const auto server, parse_server_url(options.server));
  const auto timeout = std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * options.timeout_s));
  TRY_ASSIGN(auto reply,
             http_request(server, HttpMethod::post, "/v1/energy-matrix", request.dump(), timeout));
  if (!reply.ok()) return tl::unexpected(error_of(reply));
  return std::move(reply.body);
}

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

void print_matrix(const Json& answer) {
  const Json& tasks = answer["tasks"];
  const Json& rows = answer["rows"];
  const std::size_t columns = std::min(tasks.size(), most_columns);
  fmt::print("{:<20}", "energy J (s, chance)");
  for (std::size_t t = 0; t < columns; ++t) fmt::print(" {:>24}", tasks[t].get<std::string>());
  std::puts("");
  for (const Json& row : rows) {
    fmt::print("{:<20}", row["robot_id"].get<std::string>());
    for (std::size_t t = 0; t < columns; ++t) {
      const Json& energy = row["energy_j"][t];
      std::string cell = "-";
      if (energy.is_number()) {
        cell = fmt::format("{:.1f} ({:.1f}", energy.get<double>(), row["duration_s"][t].get<double>());
        if (const auto chance = row.find("success_probability"); chance != row.end() && chance->is_array())
          cell += fmt::format(", {:.0f} %", std::floor(1e2 * (*chance)[t].get<double>()));
        cell += ")";
      }
      fmt::print(" {:>24}", cell);
    }
    std::puts("");
    for (const Json& why : row["infeasible"])
      fmt::print("  {} of {} tasks: {}\n", why["tasks"].size(), tasks.size(),
                 why["detail"].get<std::string>());
  }
  if (tasks.size() > columns)
    fmt::print("... and {} tasks more: --json has them all\n", tasks.size() - columns);
  std::puts("cheapest robot for each task:");
  for (std::size_t t = 0; t < std::min<std::size_t>(tasks.size(), 50); ++t) {
    const Json* best = nullptr;
    for (const Json& row : rows) {
      const Json& energy = row["energy_j"][t];
      if (energy.is_number() && (best == nullptr || energy < (*best)["energy_j"][t])) best = &row;
    }
    fmt::print("  {:<20} {}\n", tasks[t].get<std::string>(),
               best == nullptr ? std::string("none can do it")
                               : fmt::format("{} {:.1f} J", (*best)["robot_id"].get<std::string>(),
                                             (*best)["energy_j"][t].get<double>()));
  }
}

Result<Json> matrix_request(const MatrixOptions& options) {
  TRY_ASSIGN(const auto text, read_file(options.request_file));
  auto request = parse_json(text);
  if (!request) return invalid(options.request_file, describe(request.error()));
  if (!request->is_object()) return invalid(options.request_file, "is not a JSON object");
  if (!options.driving.empty()) (*request)["driving"] = options.driving;
  return request;
}

Exit run_matrix(const MatrixOptions& options) {
  const auto request = matrix_request(options);
  if (!request) return report(request.error());
  const auto text =
      options.server.empty() ? answer_here(options, *request) : ask_for_matrix(options, *request);
  if (!text) return report(text.error());
  if (options.json) {
    std::puts(text->c_str());
    return Exit::ok;
  }
  const Json document = Json::parse(*text, nullptr, false);
  if (!document.is_object() || !document.contains("rows") || !document.contains("tasks"))
    return report({Fault::corrupt, options.server, "did not answer with an energy matrix"});
  print_matrix(document);
  return Exit::ok;
}

}  // namespace

void add_matrix(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<MatrixOptions>();
  auto* command = program.add_subcommand("matrix", "Compute the energy of every robot on every task");
  command
      ->add_option("request", options->request_file,
                   "request as JSON (schemas/energy-matrix-request.schema.json), - for standard input")
      ->required();
  auto* files = command->add_option("--robot", options->robot_files,
                                    "robot file, once a robot: answer here, without a server, for all of "
                                    "them where the request names no robots");
  command
      ->add_option("--driving", options->driving,
                   "by minimum-energy profiles (the default), or as each robot usually drives")
      ->check(one_of({"usual", "minimum_energy"}));
  auto* server =
      command->add_option("--server", options->server, "joulecastd to send the request to, host:port");
  server->excludes(files);
  command->add_option("--timeout", options->timeout_s, "seconds to wait for the server")
      ->check(positive())
      ->capture_default_str();
  command->add_flag("--json", options->json, "print the answer as the server sends it");
  add_example(*command, example);
  command->callback([options, &exit] {
    if (options->robot_files.empty() && options->server.empty())
      throw CLI::RequiredError("--robot or --server");
    exit = run_matrix(*options);
  });
}

}  // namespace joulecast::client
