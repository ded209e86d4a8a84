#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/table.h"

namespace joulecast::client {
namespace {

// What may follow each command line so far: "calibrate drive" -> its options and subcommands.
using Words = std::map<std::string, std::vector<std::string>>;

void collect(const CLI::App& app, const std::string& path, Words& words) {
  auto& here = words[path];
  for (const CLI::Option* option : app.get_options()) {
    for (const auto& name : option->get_lnames()) here.push_back("--" + name);
  }
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (sub->get_name().empty()) {  // an option group: its options belong to the command
      for (const CLI::Option* option : sub->get_options()) {
        for (const auto& name : option->get_lnames()) here.push_back("--" + name);
      }
      continue;
    }
    here.push_back(sub->get_name());
  }
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!sub->get_name().empty())
      collect(*sub, path.empty() ? sub->get_name() : path + ' ' + sub->get_name(), words);
  }
}

std::string bash(const CLI::App& program) {
  Words words;
  collect(program, "", words);
  std::string cases;
  for (const auto& [path, list] : words) {
    cases += fmt::format("    \"{}\") echo \"{}\" ;;\n", path, fmt::join(list, " "));
  }
  return fmt::format(R"(_joulecast_words() {{
  case $1 in
{}    *) return 1 ;;
  esac
}}
_joulecast() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} path= next words i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    next="${{path:+$path }}${{COMP_WORDS[i]}}"
    _joulecast_words "$next" >/dev/null || break # an option or a file ends the command's name
    path=$next
  done
  words=$(_joulecast_words "$path")
  case $word in
    -*) ;;
    *) words=$(printf '%s\n' $words | grep -v '^-') ;;
  esac
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _joulecast joulecast
)",
                     cases);
}

}  // namespace

void add_completion(CLI::App& program, Exit& exit) {
  auto shell = std::make_shared<std::string>("bash");
  auto* command = program.add_subcommand("completion",
                                         "Print what lets a shell complete joulecast's commands and options");
  command->add_option("shell", *shell, "bash, or zsh")
      ->check(CLI::IsMember({"bash", "zsh"}))
      ->capture_default_str();
  command->callback([shell, &program, &exit] {
    const std::string prefix = *shell == "zsh" ? "autoload -U +X bashcompinit && bashcompinit\n" : "";
    std::fputs((prefix + bash(program)).c_str(), stdout);
    exit = Exit::ok;
  });
}

}  // namespace joulecast::client
