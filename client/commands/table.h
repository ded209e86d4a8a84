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

void add_replay(CLI::App& program, Exit& exit);
void add_simulate(CLI::App& program, Exit& exit);

}  // namespace joulecast::client
