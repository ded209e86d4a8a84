#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/commands/option.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/virtual_robot/imperfections.h"
#include "dynamics/catalogue.h"

namespace joulecast::client {
namespace {

namespace fs = std::filesystem;

// The position in the command line that results from the words before the last one.
struct Place {
  CLI::App* app = nullptr;
  const CLI::Option* open = nullptr;  // waits for a value
  bool open_may_end = false;          // has one already, and takes more
  std::vector<const CLI::Option*> given{};
  std::size_t positionals = 0;
  std::string server{};
};

bool takes_many(const CLI::Option& option) {
  return option.get_expected_max() == CLI::detail::expected_max_vector_size;
}

CLI::App* visible_command(CLI::App& app, const std::string& name) {
  for (CLI::App* command : app.get_subcommands(is_visible_command))
    if (command->get_name() == name) return command;
  return nullptr;
}

Place place_of(CLI::App& program, const std::vector<std::string>& words) {
  Place at{.app = &program};
  for (std::size_t k = 0; k + 1 < words.size(); ++k) {
    const std::string& word = words[k];
    if (word.size() > 1 && word.front() == '-') {
      const std::string name = word.substr(0, word.find('='));
      const CLI::Option* option = at.app->get_option_no_throw(name);
      if (option != nullptr) at.given.push_back(option);
      const bool waits = option != nullptr && option->get_items_expected_max() != 0 && name == word;
      at.open = waits ? option : nullptr;
      at.open_may_end = false;
    } else if (at.open != nullptr) {
      if (at.open->check_lname("server")) at.server = word;
      if (takes_many(*at.open))
        at.open_may_end = true;
      else
        at.open = nullptr;
    } else if (CLI::App* sub = visible_command(*at.app, word); sub != nullptr && at.positionals == 0) {
      at.app = sub;
    } else {
      ++at.positionals;
    }
  }
  return at;
}

// Files and folders that begin as `begin` does; of files only those with `ending` (".json").
std::vector<std::string> files(const std::string& begin, const std::string& ending) {
  const std::size_t slash = begin.rfind('/');
  const std::string folder = slash == std::string::npos ? "" : begin.substr(0, slash + 1);
  const std::string name = begin.substr(folder.size());
  std::vector<std::string> found;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder.empty() ? "." : folder, ignored)) {
    const std::string own = entry.path().filename().string();
    if (!own.starts_with(name) || (own.front() == '.' && name.empty())) continue;
    if (entry.is_directory(ignored))
      found.push_back(folder + own + '/');
    else if (!ending.empty() && own.ends_with(ending))
      found.push_back(folder + own);
  }
  std::ranges::sort(found);
  return found;
}

std::vector<std::string> robots_of(const std::string& server) {
  const auto reply = http_request(server, HttpMethod::get, "/v1/robots", {}, std::chrono::seconds(1));
  if (!reply || !reply->ok()) return {};
  const auto answer = nlohmann::json::parse(reply->body, nullptr, false);
  std::vector<std::string> ids;
  if (!answer.is_object() || !answer.contains("robots")) return ids;
  for (const auto& robot : answer["robots"]) ids.push_back(robot.value("robot_id", ""));
  return ids;
}

std::vector<std::string> values(const CLI::Option& option, const Place& at, const std::string& begin) {
  const std::string kind = value_name(option);
  std::vector<std::string> words;
  if (kind.starts_with('{')) return CLI::detail::split(kind.substr(1, kind.size() - 2), ',');
  if (kind.starts_with("FILE")) return files(begin, kind.substr(4));
  if (kind == "URL" && option.check_lname("server")) return {"http://127.0.0.1:8080"};
  if (kind == "ROBOT" && !at.server.empty()) return robots_of(at.server);
  if (kind == "EFFECT")
    for (const dynamics::Effect* effect : dynamics::catalogue()) words.emplace_back(effect->info().id);
  if (kind == "EFFECT=STRENGTH")
    for (const auto& effect : virtual_robot::all_effects()) words.push_back(std::string(effect.id) + '=');
  return words;
}

void add_options(CLI::App& app, const Place& at, std::vector<Candidate>& out) {
  for (const CLI::Option* option : app.get_options()) {
    const bool again = std::ranges::find(at.given, option) != at.given.end() && !takes_many(*option);
    if (again || option->get_group().empty()) continue;
    for (const auto& name : option->get_lnames()) out.push_back({"--" + name, option->get_description()});
  }
  for (CLI::App* group : app.get_subcommands([](const CLI::App* sub) { return sub->get_name().empty(); }))
    add_options(*group, at, out);
}

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

std::vector<Candidate> candidates(CLI::App& program, const std::vector<std::string>& words) {
  const std::string begin = words.empty() ? "" : words.back();
  const Place at = place_of(program, words);
  std::vector<Candidate> all;
  const auto add_values = [&](const CLI::Option& option) {
    for (auto& text : values(option, at, begin)) all.push_back({std::move(text), ""});
  };
  const bool option_begun = begin.starts_with('-');
  if (at.open != nullptr && !(at.open_may_end && option_begun)) {
    add_values(*at.open);
  } else if (option_begun) {
    add_options(*at.app, at, all);
  } else {
    if (at.positionals == 0)
      for (const CLI::App* sub : at.app->get_subcommands(is_visible_command))
        all.push_back({sub->get_name(), sub->get_description()});
    std::vector<const CLI::Option*> positionals;
    for (const CLI::Option* option : at.app->get_options())
      if (option->get_positional() && !option->get_group().empty()) positionals.push_back(option);
    if (!positionals.empty() && (at.positionals < positionals.size() || takes_many(*positionals.back())))
      add_values(*positionals[std::min(at.positionals, positionals.size() - 1)]);
    if (all.empty() && begin.empty()) add_options(*at.app, at, all);
  }
  std::erase_if(all, [&begin](const Candidate& c) { return !c.text.starts_with(begin); });
  return all;
}

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
