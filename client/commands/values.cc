#include "client/commands/values.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <string_view>

#include "client/virtual_robot/imperfections.h"
#include "dynamics/catalogue.h"

namespace joulecast::client {
namespace {

struct Named {
  std::string_view command;  // empty: of any
  std::string_view option;
  std::string_view name;
  std::string_view files;
};

// Options with a text value. The more specific line precedes.
constexpr auto value_names = std::to_array<Named>({
    {"", "--robot", "FILE", "*.json"},
    {"", "--server", "URL", ""},
    {"", "--lcm-url", "URL", ""},
    {"", "--robot-id", "ID", ""},
    {"", "--mission-id", "ID", ""},
    {"", "--request", "FILE", "*.json"},
    {"", "--turn", "ANGLE", ""},
    {"matrix", "request", "FILE", "*.json"},
    {"", "log", "FILE", "*.lcmlog"},
    {"check", "file", "FILE", "*.json"},
    {"check", "--mapping", "FILE", "*.json"},
    {"import", "table", "FILE", "*.csv"},
    {"import", "--mapping", "FILE", "*.json"},
    {"import", "--out", "FILE", "*.lcmlog"},
    {"import", "--start", "TIME", ""},
    {"", "recordings", "FILE", "*.csv"},
    {"export missions", "--out", "FILE", "*.csv"},
    {"export floor", "--out", "FILE", "*.csv"},
    {"export rmf", "--config", "FILE", "*.yaml"},
    {"export rmf", "--out", "FILE", "*.yaml"},
    {"export telemetry", "--out", "FILE", "*.csv"},
    {"export trace", "--out", "FILE", "*.csv"},
    {"", "--out", "FILE", "*.json"},
    {"calibrate drive", "--train", "ID", ""},
    {"battery predict", "--battery", "FILE", "*.json"},
    {"", "--plot", "FILE", "*.svg"},
    {"replay", "--into", "FILE", "*.db"},
    {"", "--file", "FILE", "*.json"},
    {"", "--store", "FILE", "*.db"},
    {"store copy", "--from", "FILE", "*.db"},
    {"store copy", "--to", "FILE", "*.db"},
    {"", "--name", "NAME", ""},
    {"token create", "--robots", "PATTERN", ""},
    {"audit verify", "--head", "HASH", ""},
    {"simulate", "--start", "TIME", ""},
    {"simulate", "--key-file", "FILE", "*.json"},
    {"simulate", "--log", "FILE", "*.lcmlog"},
    {"simulate", "--truth", "FILE", "*.json"},
    {"gap", "--missions", "FILE", "*.csv"},
    {"gap", "--apply", "FILE", "*.json"},
    {"gap", "--effect", "ID", ""},
    {"gap", "--report", "FILE", "*.html"},
    {"gap", "--compare-by", "LABEL", ""},
    {"gap", "--test", "FILE", "*.lcmlog"},
    {"simulate", "--effect", "ID=STRENGTH", ""},
    {"", "--model", "FILE", "*.json"},
    {"adopt", "--note", "WORDS", ""},
    {"adopt", "--effect", "ID", ""},
    {"export missions", "--from", "TIME", ""},
    {"export missions", "--to", "TIME", ""},
    {"export floor", "--from", "TIME", ""},
    {"export floor", "--to", "TIME", ""},
    {"export floor", "--cell", "METRES", ""},
    {"export rmf", "--missions", "COUNT", ""},
    {"export trace", "--points", "COUNT", ""},
    {"missions", "--from", "TIME", ""},
    {"missions", "--to", "TIME", ""},
    {"missions", "--payload-min", "NUMBER", ""},
    {"missions", "--payload-max", "NUMBER", ""},
    {"missions", "--limit", "COUNT", ""},
    {"missions", "--cursor", "TEXT", ""},
});

// "{a,b}" -> {a, b}.
std::vector<std::string> words_of(std::string_view set) {
  std::vector<std::string> words;
  for (set = set.substr(1, set.size() - 2); !set.empty();) {
    const std::size_t comma = std::min(set.find(','), set.size());
    words.emplace_back(set.substr(0, comma));
    set.remove_prefix(std::min(comma + 1, set.size()));
  }
  return words;
}

std::vector<std::string> special_words(std::string_view command, std::string_view option) {
  std::vector<std::string> words;
  if (command == "simulate" && option == "--effect") {
    for (const auto& effect : virtual_robot::all_effects()) words.push_back(std::string(effect.id) + '=');
  } else if ((command == "gap" || command == "adopt") && option == "--effect") {
    for (const dynamics::Effect* effect : dynamics::catalogue()) words.emplace_back(effect->info().id);
  }
  return words;
}

}  // namespace

ValueKind value_kind(const CLI::Option& option, const std::string& command) {
  ValueKind kind;
  if (option.get_items_expected_max() == 0) return kind;
  // "FLOAT", or with a check of accepts.h "FLOAT:0 to 1" or "TEXT:{a,b}".
  const std::string type = option.get_type_name();
  const std::size_t colon = std::min(type.find(':'), type.size());
  const std::string accepted = type.substr(std::min(colon + 1, type.size()));
  const std::string name = option.get_positional() ? option.get_name(true, false) : option.get_name();
  if (accepted.starts_with('{')) {
    kind.name = accepted;
    kind.words = words_of(accepted);
    return kind;
  }
  kind.bounds = accepted;
  const std::string base = type.substr(0, colon);
  kind.name = base == "FLOAT" ? "NUMBER" : base == "INT" || base == "UINT" ? "COUNT" : base;
  const auto own = std::ranges::find_if(value_names, [&](const Named& row) {
    return row.option == name && (row.command.empty() || row.command == command);
  });
  if (own != value_names.end() && kind.name == "TEXT") {
    kind.name = own->name;
    kind.files = own->files;
    kind.words = special_words(command, name);
  }
  return kind;
}

std::string command_path(const CLI::App& app) {
  std::string path;
  for (const CLI::App* at = &app; at->get_parent() != nullptr; at = at->get_parent())
    if (!at->get_name().empty()) path = at->get_name() + (path.empty() ? "" : " " + path);
  return path;
}

}  // namespace joulecast::client
