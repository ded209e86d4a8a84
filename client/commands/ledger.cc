#include <fmt/format.h>

#include <string>

#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"

namespace joulecast::client {
namespace {

struct LedgerOptions {
  std::string server, mission, unit = energy_units.front();
  bool json = false;
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
