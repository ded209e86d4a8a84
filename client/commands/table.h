#pragma once

#include "client/commands/option.h"

namespace joulecast::client {

// Every subcommand of joulecast, in the order that --help lists them. A new one is a file and a word here.
// clang-format off
#define FOR_EACH_COMMAND(DO)                                                                               \
  DO(profile) DO(estimate) DO(autonomy) DO(matrix) DO(robots) DO(state) DO(missions) DO(ledger) DO(export) \
  DO(proposals) DO(adopt) DO(check) DO(import) DO(replay) DO(spy) DO(simulate) DO(calibrate) DO(battery)   \
  DO(gap) DO(effects) DO(store) DO(key) DO(token) DO(audit) DO(completion)
// clang-format on

#define DECLARE_COMMAND(name) void add_##name(CLI::App& program, Exit& exit);
FOR_EACH_COMMAND(DECLARE_COMMAND)
#undef DECLARE_COMMAND

// Adds the subcommands to the program; when one is chosen, parsing runs it and leaves its outcome in `exit`,
// which must outlive the parse.
inline void add_commands(CLI::App& program, Exit& exit) {
#define ADD_COMMAND(name) add_##name(program, exit);
  FOR_EACH_COMMAND(ADD_COMMAND)
#undef ADD_COMMAND
}

struct Candidate {
  std::string text;  // ends in '/' or '=' where more is to follow
  std::string meaning;
};

// Completions of the last of `words`, which are a command line without the program's name, in the order of
// the help. Files are those of the working directory; ids of robots come from its server.
[[nodiscard]] std::vector<Candidate> candidates(CLI::App& program, const std::vector<std::string>& words);

// Subcommands of export.
void add_export_rmf(CLI::App& group, Exit& exit);

// Subcommands of calibrate.
void add_calibrate_drive(CLI::App& calibrate, Exit& exit);

}  // namespace joulecast::client
