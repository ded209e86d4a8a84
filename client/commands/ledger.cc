#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/commands/accepts.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"

namespace joulecast::client {
namespace {

using Json = nlohmann::json;

struct LedgerOptions {
  std::string server;
  std::int64_t mission = 0;
  bool json = false;
};

void print_ledger(const Json& answer) {
  const Json& ledger = answer["ledger"];
  const double whole = ledger["battery_j"].is_number() ? ledger["battery_j"].get<double>() : 0;
  fmt::print("{} of {} (model version {}): {:.2f} J from the battery\n", text_of(answer["mission_id"]),
             text_of(answer["robot_id"]), text_of(answer["model_version"]), whole);
  constexpr double shown_j = 0.005;
  for (const auto& [term, joules] : ledger["terms_j"].items()) {
    if (!joules.is_number() || std::fabs(joules.get<double>()) < shown_j) continue;
    const double value = effect_on_sum(term, joules.get<double>());
    fmt::print("  {:<20} {:>12.2f} J", term, value);
    if (whole != 0) fmt::print(" {:>7.1f} %", 100 * value / whole);
    fmt::print("\n");
  }
}

Exit run_ledger(const LedgerOptions& options) {
  const std::string target = "/v1/missions/" + std::to_string(options.mission) + "/ledger";
  return show(options.server, target, {{"id", "mission"}}, options.json, print_ledger);
}

}  // namespace

void add_ledger(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<LedgerOptions>();
  auto* command = program.add_subcommand("ledger", "Show where the energy of a mission went");
  command->add_option("mission", options->mission, "number of the mission, as joulecast missions lists it")
      ->required()
      ->check(positive());
  add_server(*command, options->server);
  command->add_flag("--json", options->json, "print the answer as the server sends it");
  command->callback([options, &exit] { exit = run_ledger(*options); });
}

}  // namespace joulecast::client
