#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace joulecast::client {

// The kind of value of an option or a positional: its name in the help and its completion in a shell.
struct ValueKind {
  std::string name;                // "FILE", "NUMBER", "{usual,minimum_energy}"; empty for a flag
  std::string files;               // "*.json": files of that name; "/": folders; empty: none
  std::vector<std::string> words;  // all that it may be, or how it may begin where a word ends in '='
  std::string bounds;              // "0 to 1", "at least 1"; empty: none
};

// `command` is the path of names, "calibrate drive".
[[nodiscard]] ValueKind value_kind(const CLI::Option& option, const std::string& command);

// "gap trial" of that subcommand's App; empty for the program itself.
[[nodiscard]] std::string command_path(const CLI::App& app);

}  // namespace joulecast::client
