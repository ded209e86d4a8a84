#pragma once

#include <CLI/CLI.hpp>
#include <memory>

#include "client/commands/outcome.h"

namespace joulecast::client {

// Subcommands of a group that work on the file given by --file; `meaning` describes it.
template <class Options>
class FileCommands {
 public:
  FileCommands(CLI::App& group, const char* meaning, Exit& exit)
      : group_(group), meaning_(meaning), exit_(exit) {}

  CLI::App* add(const char* name, const char* what, Exit (*run)(const Options&)) {
    auto* command = group_.add_subcommand(name, what);
    command->add_option("--file", options_->file, meaning_)->required();
    command->callback([options = options_, run, &exit = exit_] { exit = run(*options); });
    return command;
  }
  // Filled by the parse.
  Options* operator->() { return options_.get(); }

 private:
  CLI::App& group_;
  const char* meaning_;
  Exit& exit_;
  std::shared_ptr<Options> options_ = std::make_shared<Options>();
};

}  // namespace joulecast::client
