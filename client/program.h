#pragma once

#include <string>

#include "client/commands/outcome.h"

namespace CLI {
class App;
}

namespace joulecast::client {

// Sets up the features of every command-line program: help that fits the terminal, --version (which prints
// `version`), exit codes. Subcommands are added afterwards, since they inherit the format of the help.
void prepare(CLI::App& program, const std::string& version);

// Parses the command line, which runs the chosen subcommand, and returns the exit code; `exit` is where the
// subcommands leave theirs.
int run(CLI::App& program, int argc, char** argv, const Exit& exit);

}  // namespace joulecast::client
