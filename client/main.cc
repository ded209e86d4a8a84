#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "client/commands/examples.h"
#include "client/commands/help.h"
#include "client/commands/table.h"
#include "client/commands/wrong_use.h"
#include "client/wrapped.h"

int main(int argc, char** argv) {
  using joulecast::client::Exit;
  CLI::App program("joulecast: what a fleet of differential-drive robots spends, will spend and could save",
                   "joulecast");
  program.formatter(std::make_shared<joulecast::client::HelpFormatter>(joulecast::client::help_width()));
  program.get_help_ptr()->description("print this help and exit");
  program.set_version_flag("--version", "joulecast " JOULECAST_VERSION, "print the version and exit");
  program.footer(joulecast::client::exit_codes_help);
  program.require_subcommand(1);
  Exit exit = Exit::ok;
  for (const auto add : joulecast::client::commands()) add(program, exit);
  joulecast::client::add_examples(program);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // Help and version come this way too, with code 0; every other parse error is wrong use.
    if (error.get_exit_code() == 0) return program.exit(error);
    std::fputs(joulecast::client::wrong_use(program, error).c_str(), stderr);
    return static_cast<int>(Exit::usage);
  }
  return static_cast<int>(exit);
}
