#pragma once

#include "client/commands/option.h"

namespace CLI {
class App;
}

namespace joulecast::client {

// The subcommands of joulecast-study, as client/commands/table.h has those of joulecast.
void add_trial(CLI::App& program, Exit& exit);
void add_thesis(CLI::App& program, Exit& exit);
void add_explore(CLI::App& program, Exit& exit);
void add_posterior(CLI::App& program, Exit& exit);

}  // namespace joulecast::client
