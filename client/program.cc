#include "client/program.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <new>
#include <utility>
#include <vector>

#include "client/commands/help.h"
#include "client/wrapped.h"

namespace joulecast::client {

void prepare(CLI::App& program, const std::string& version) {
  program.formatter(std::make_shared<HelpFormatter>(help_width()));
  program.get_help_ptr()->description("print this help and exit");
  program.set_version_flag("--version", version, "print the version and exit");
  program.require_subcommand(1);
}

int run(CLI::App& program, int argc, char** argv, const Exit& exit) {
  // `joulecast help missions` as `joulecast missions --help`.
  std::vector<std::string> words(argv + 1, argv + argc);
  if (!words.empty() && words.front() == "help") {
    words.erase(words.begin());
    words.emplace_back("--help");
  }
  std::ranges::reverse(words);  // as the parser takes them
  try {
    program.parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    // Help and version come this way too, with code 0; every other parse error is wrong use.
    if (error.get_exit_code() == 0) return program.exit(error);
    std::fputs(wrong_use(program, error).c_str(), stderr);
    return static_cast<int>(Exit::usage);
  } catch (const std::bad_alloc&) {
    return static_cast<int>(report({Fault::too_large, "", "needs more memory than there is"}));
  }
  return static_cast<int>(exit);
}

}  // namespace joulecast::client
