// joulecast-study: what the method's probabilities and the thesis's numbers are measured with. Nothing that
// an operator's robots need.
#include <CLI/CLI.hpp>

#include "client/program.h"
#include "tests/study/study_commands.h"

int main(int argc, char** argv) {
  using namespace joulecast::client;
  CLI::App program("joulecast-study: blind trials of the diagnosis, and the thesis's tables",
                   "joulecast-study");
  prepare(program, "joulecast-study " JOULECAST_VERSION);
  Exit exit = Exit::ok;
  add_trial(program, exit);
  add_thesis(program, exit);
  add_posterior(program, exit);
  return run(program, argc, argv, exit);
}
