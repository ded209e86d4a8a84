#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <filesystem>
#include <string>
#include <vector>

#include "client/commands/table.h"

namespace joulecast::client {
namespace {

// Replaces this process by joulecast-study in the folder of joulecast; returns only if that is missing.
Exit run_study(const std::string& command, std::vector<std::string> rest) {
  std::error_code unreadable;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", unreadable);
  const std::string study = (self.parent_path() / "joulecast-study").string();
  rest.insert(rest.begin(), {study, command});
  std::vector<char*> arguments;
  for (std::string& word : rest) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  execv(study.c_str(), arguments.data());
  return report({Fault::not_found, "",
                 fmt::format("{} is a command of joulecast-study, and {} cannot be run: {}", command, study,
                             std::generic_category().message(errno))});
}

void hand_on(CLI::App& app, const std::string& name, Exit& exit) {
  auto* command = app.add_subcommand(name, "A command of joulecast-study");
  command->group("")->set_help_flag();
  command->prefix_command();
  command->callback([command, name, &exit] {
    auto rest = command->remaining();
    exit = run_study(name, std::move(rest));
  });
}

}  // namespace

void add_study(CLI::App& program, Exit& exit) {
  hand_on(program, "thesis", exit);
  hand_on(program, "explore", exit);
  hand_on(*program.get_subcommand("gap"), "trial", exit);
}

}  // namespace joulecast::client
