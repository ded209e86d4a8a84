#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>
#include <vector>

#include "client/commands/help.h"
#include "client/commands/table.h"
#include "fuzz.h"

using namespace joulecast;

namespace {

CLI::App& program() {
  static CLI::App app("joulecast", "joulecast");
  static client::Exit exit = client::Exit::ok;
  static const bool ready = [] {
    client::add_commands(app, exit);
    app.require_subcommand(1);
    // Parsed commands are not run.
    app.parse_complete_callback([] { throw CLI::Success(); });
    return true;
  }();
  (void)ready;
  return app;
}

}  // namespace

// Arguments of the command line, one per line.
JOULECAST_FUZZ_TARGET(arguments) {
  std::vector<std::string> arguments;
  std::string text(testing::as_text(data, size));
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    arguments.insert(arguments.begin(), text.substr(begin, end - begin));  // CLI11 expects reverse order
    begin = end + 1;
  }
  try {
    program().parse(std::move(arguments));
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) testing::require(!client::wrong_use(program(), error).empty());
  }
}
