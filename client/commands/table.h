#pragma once

#include <span>

#include "client/commands/outcome.h"

namespace CLI {
class App;
}

namespace joulecast::client {

// Adds one subcommand to the program; when that subcommand is chosen, parsing runs it and leaves its outcome
// in `exit`, which must outlive the parse.
using AddCommand = void (*)(CLI::App& program, Exit& exit);

// Every subcommand of joulecast, in the order that --help lists them. A new one is a file and a line here.
[[nodiscard]] std::span<const AddCommand> commands();

void add_adopt(CLI::App& program, Exit& exit);
void add_audit(CLI::App& program, Exit& exit);
void add_autonomy(CLI::App& program, Exit& exit);
void add_battery(CLI::App& program, Exit& exit);
void add_calibrate(CLI::App& program, Exit& exit);
void add_check(CLI::App& program, Exit& exit);
void add_completion(CLI::App& program, Exit& exit);
void add_effects(CLI::App& program, Exit& exit);
void add_estimate(CLI::App& program, Exit& exit);
void add_export(CLI::App& program, Exit& exit);
void add_gap(CLI::App& program, Exit& exit);
void add_import(CLI::App& program, Exit& exit);
void add_ledger(CLI::App& program, Exit& exit);
void add_matrix(CLI::App& program, Exit& exit);
void add_missions(CLI::App& program, Exit& exit);
void add_profile(CLI::App& program, Exit& exit);
void add_proposals(CLI::App& program, Exit& exit);
void add_replay(CLI::App& program, Exit& exit);
void add_robots(CLI::App& program, Exit& exit);
void add_simulate(CLI::App& program, Exit& exit);
void add_spy(CLI::App& program, Exit& exit);
void add_state(CLI::App& program, Exit& exit);
void add_store(CLI::App& program, Exit& exit);
// Adds `thesis` and `gap trial`, which execute joulecast-study. To be called after add_gap.
void add_study(CLI::App& program, Exit& exit);
void add_key(CLI::App& program, Exit& exit);
void add_token(CLI::App& program, Exit& exit);

// Subcommands of export.
void add_export_rmf(CLI::App& group, Exit& exit);

// Subcommands of calibrate.
void add_calibrate_drive(CLI::App& calibrate, Exit& exit);

}  // namespace joulecast::client
