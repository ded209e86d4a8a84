#pragma once

#include <string>

#include "client/commands/outcome.h"

namespace CLI {
class App;
}

namespace joulecast::client {

// What every program of the command line has: help that fits the terminal, --version (`version` is what it
// prints), exit codes. Subcommands are added afterwards, since they take the help's form over.
void prepare(CLI::App& program, const std::string& version);

// Parses the command line, which runs the chosen subcommand, and returns the exit code; `exit` is where the
// subcommands leave theirs.
int run(CLI::App& program, int argc, char** argv, const Exit& exit);

}  // namespace joulecast::client
