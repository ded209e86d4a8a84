#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/candidates.h"
#include "client/commands/option.h"
#include "client/commands/table.h"

namespace joulecast::client {
namespace {

// Each shell passes its command line's words to `candidates` and shows the output.
constexpr const char* bash = R"script(_joulecast() {
  local line
  COMPREPLY=()
  while IFS= read -r line; do
    COMPREPLY+=("$(printf %q "$line")")
  done < <("${COMP_WORDS[0]}" candidates bash -- "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null)
  if [[ ${#COMPREPLY[@]} -eq 1 && ${COMPREPLY[0]} == *[/=] ]]; then compopt -o nospace; fi
}
complete -F _joulecast joulecast
)script";

constexpr const char* zsh = R"script((( $+functions[compdef] )) || { autoload -Uz compinit && compinit; }
_joulecast() {
  local -a all
  all=("${(@f)$("${words[1]}" candidates zsh -- "${(@)words[2,CURRENT]}" 2>/dev/null)}")
  compadd -S '' -- ${(M)all:#*[/=]}
  compadd -- ${all:#*[/=]}
}
compdef _joulecast joulecast
)script";

constexpr const char* fish = R"script(function __joulecast
  set -l words (commandline -opc) (commandline -ct)
  $words[1] candidates fish -- $words[2..-1] 2>/dev/null
end
complete -c joulecast -f -a '(__joulecast)'
)script";

struct CompletionOptions {
  std::string shell = "bash";
  std::vector<std::string> words;
};

}  // namespace

void add_completion(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<CompletionOptions>();
  auto* command = program.add_subcommand("completion", "Print a completion script for a shell");
  add_option(*command, "shell", options->shell, "shell of the script", one_of({"bash", "zsh", "fish"}));
  add_examples(*command,
               "source <(joulecast completion bash)\n"
               "joulecast completion zsh > _joulecast.zsh\n"
               "joulecast completion fish > joulecast.fish");
  command->callback([options, &exit] {
    exit = Exit::ok;
    std::fputs(options->shell == "fish" ? fish : options->shell == "zsh" ? zsh : bash, stdout);
  });
  auto* hidden = program.add_subcommand("candidates", "Print the completions of the last word for a script");
  hidden->group("");
  hidden->add_option("shell", options->shell)->group("");
  hidden->add_option("words", options->words)->group("");
  hidden->callback([options, &program, &exit] {
    exit = Exit::ok;
    for (const Candidate& c : candidates(program, options->words)) {
      const bool described = options->shell == "fish" && !c.meaning.empty();
      std::printf("%s%s%s\n", c.text.c_str(), described ? "\t" : "", described ? c.meaning.c_str() : "");
    }
  });
}

}  // namespace joulecast::client
