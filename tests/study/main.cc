// joulecast-study: measures the method's probabilities and the numbers of the thesis. Not needed in
// operation.
#include <CLI/CLI.hpp>

#include "client/commands/help.h"
#include "tests/study/study_commands.h"

int main(int argc, char** argv) {
  using namespace joulecast::client;
  CLI::App program("joulecast-study: blind trials of the diagnosis, and the thesis's tables",
                   "joulecast-study");
  prepare(program, "joulecast-study " JOULECAST_VERSION);
  Exit exit = Exit::ok;
  add_trial(program, exit);
  add_thesis(program, exit);
  add_explore(program, exit);
  add_posterior(program, exit);
  return run(program, argc, argv, exit);
}
