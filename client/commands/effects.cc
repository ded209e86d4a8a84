#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "client/commands/table.h"
#include "dynamics/catalogue_text.h"

namespace joulecast::client {

void add_effects(CLI::App& program, Exit& exit) {
  auto markdown = std::make_shared<bool>(false);
  auto* command = program.add_subcommand(
      "effects", "List the effects that a robot file can adopt and a diagnosis can find");
  command->add_flag("--markdown", *markdown, "the whole document: parameters, bounds, validity, sources");
  command->callback([markdown, &exit] {
    const std::string text = *markdown ? dynamics::catalogue_markdown() : dynamics::catalogue_listing();
    std::printf("%s", text.c_str());
    exit = Exit::ok;
  });
}

}  // namespace joulecast::client
