#include "client/commands/help.h"
#include "client/commands/table.h"

int main(int argc, char** argv) {
  using namespace joulecast::client;
  CLI::App program(
      "joulecast: energy accounting, forecasts and planning for fleets of differential-drive robots",
      "joulecast");
  prepare(program, "joulecast " JOULECAST_VERSION);
  Exit exit = Exit::ok;
  add_commands(program, exit);
  return run(program, argc, argv, exit);
}
