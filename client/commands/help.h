#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "client/commands/option.h"

namespace joulecast::client {

// Help with lines that fit the terminal, names of the options' values, and defaults after the meanings.
class HelpFormatter : public CLI::Formatter {
 public:
  explicit HelpFormatter(std::size_t width) : width_(width) {
    column_width(28);
    label("Positionals", "Arguments");
    label("SUBCOMMAND", "COMMAND");
  }

  std::string make_usage(const CLI::App* app, std::string name) const override;
  std::string make_description(const CLI::App* app) const override;
  std::string make_expanded(const CLI::App* group) const override;
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_subcommand(const CLI::App* sub) const override;
  std::string make_footer(const CLI::App* app) const override;

 private:
  std::string row(const std::string& left, const std::string& text) const;

  std::size_t width_;
};

// The message for an invalid command line, with a suggestion, in lines that end with a newline.
[[nodiscard]] std::string wrong_use(const CLI::App& program, const CLI::ParseError& error);

// Sets up the features of every command-line program: help that fits the terminal, --version (which prints
// `version`), exit codes. Subcommands are added afterwards, since they inherit the format of the help.
void prepare(CLI::App& program, const std::string& version);

// Parses the command line, which runs the chosen subcommand, and returns the exit code; `exit` is where the
// subcommands leave theirs.
int run(CLI::App& program, int argc, char** argv, const Exit& exit);

}  // namespace joulecast::client
