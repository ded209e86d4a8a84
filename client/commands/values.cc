#include "client/commands/values.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <string_view>

#include "client/virtual_robot/imperfections.h"

namespace joulecast::client {
namespace {

struct Named {
  std::string_view command;  // empty: of any
  std::string_view option;
  std::string_view name;
  std::string_view files;
};

// Options that take text. The more special line stands first.
constexpr auto table = std::to_array<Named>({
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
    {"export telemetry", "--out", "FILE", "*.csv"},
    {"export trace", "--out", "FILE", "*.csv"},
    {"", "--out", "FILE", "*.json"},
    {"calibrate drive", "--train", "ID", ""},
    {"battery predict", "--battery", "FILE", "*.json"},
    {"", "--plot", "FILE", "*.svg"},
    {"explore", "--map", "FILE", "*.json"},
    {"replay", "--into", "FILE", "*.db"},
    {"", "--file", "FILE", "*.json"},
    {"", "--store", "FILE", "*.db"},
    {"store copy", "--from", "FILE", "*.db"},
    {"store copy", "--to", "FILE", "*.db"},
    {"", "--name", "NAME", ""},
    {"token create", "--robots", "PATTERN", ""},
    {"audit verify", "--head", "HASH", ""},
    {"simulate", "--key-file", "FILE", "*.json"},
    {"simulate", "--log", "FILE", "*.lcmlog"},
    {"simulate", "--truth", "FILE", "*.json"},
    {"gap", "--missions", "FILE", "*.csv"},
    {"gap", "--apply", "FILE", "*.json"},
    {"gap", "--effect", "ID", ""},
    {"gap", "--report", "FILE", "*.html"},
    {"gap", "--compare-by", "LABEL", ""},
    {"gap", "--test", "FILE", "*.lcmlog"},
    {"gap trial", "--keep", "FOLDER", "/"},
    {"gap trial", "--outcomes", "FILE", "*.jsonl"},
    {"gap trial", "--again", "FOLDER", "/"},
    {"gap trial", "--only", "KIND", ""},
    {"gap trial", "--motion", "FOLDER", "/"},
    {"simulate", "--effect", "ID=STRENGTH", ""},
    {"", "--model", "FILE", "*.json"},
    {"adopt", "--note", "WORDS", ""},
    {"adopt", "--effect", "ID", ""},
    {"export missions", "--from", "TIME", ""},
    {"export missions", "--to", "TIME", ""},
    {"export floor", "--from", "TIME", ""},
    {"export floor", "--to", "TIME", ""},
    {"export floor", "--cell", "METRES", ""},
    {"export trace", "--points", "COUNT", ""},
    {"missions", "--from", "TIME", ""},
    {"missions", "--to", "TIME", ""},
    {"missions", "--payload-min", "NUMBER", ""},
    {"missions", "--payload-max", "NUMBER", ""},
    {"missions", "--limit", "COUNT", ""},
    {"missions", "--cursor", "TEXT", ""},
});

// "TEXT:{a,b}" -> {a, b}; "ENUM:value in {steady->0,whole->1} OR {0,1}" -> {steady, whole}.
std::vector<std::string> members(std::string_view type) {
  const std::size_t open = type.find('{'), close = type.find('}');
  if (open == std::string_view::npos || close == std::string_view::npos) return {};
  std::vector<std::string> words;
  std::string_view list = type.substr(open + 1, close - open - 1);
  while (!list.empty()) {
    const std::size_t comma = std::min(list.find(','), list.size());
    words.emplace_back(list.substr(0, std::min(list.substr(0, comma).find("->"), comma)));
    list.remove_prefix(std::min(comma + 1, list.size()));
  }
  return words;
}

// "FLOAT:FLOAT in [0 - 1]" -> {"0", "1"}.
std::vector<std::string> ends(std::string_view type) {
  const std::size_t open = type.find('['), dash = type.find(" - "), close = type.find(']');
  if (open == std::string_view::npos || dash == std::string_view::npos || close == std::string_view::npos)
    return {};
  return {std::string(type.substr(open + 1, dash - open - 1)),
          std::string(type.substr(dash + 3, close - dash - 3))};
}

std::vector<std::string> ids(std::span<const virtual_robot::EffectEntry> effects, std::string_view end) {
  std::vector<std::string> words;
  for (const auto& effect : effects) words.push_back(std::string(effect.id) + std::string(end));
  return words;
}

std::vector<std::string> special_words(std::string_view command, std::string_view option) {
  if (command == "simulate" && option == "--effect") return ids(virtual_robot::all_effects(), "=");
  if (command == "gap" && option == "--effect") return ids(virtual_robot::effect_table(), "");
  if (command == "gap trial" && option == "--only") {
    std::vector<std::string> words = ids(virtual_robot::effect_table(), "");
    words.insert(words.begin(), {"none", "single", "double", "outside"});
    return words;
  }
  return {};
}

}  // namespace

ValueKind value_kind(const CLI::Option& option, const std::string& command) {
  ValueKind kind;
  if (option.get_items_expected_max() == 0) return kind;
  const std::string type = option.get_type_name();
  const std::string name = option.get_positional() ? option.get_name(true, false) : option.get_name();
  kind.words = members(type);
  if (!kind.words.empty()) {
    for (const auto& word : kind.words) kind.name += (kind.name.empty() ? '{' : ',') + word;
    kind.name += '}';
    return kind;
  }
  const bool count = type.starts_with("INT") || type.starts_with("UINT");
  kind.name = type.starts_with("FLOAT") ? "NUMBER" : count ? "COUNT" : "TEXT";
  if (const auto bounds = ends(type); !bounds.empty()) {
    kind.bounds = bounds[0] + " to " + bounds[1];
    if (count && bounds[1].size() == 1)
      for (char digit = bounds[0][0]; digit <= bounds[1][0]; ++digit) kind.words.emplace_back(1, digit);
  } else if (type.find("POSITIVE") != std::string::npos) {
    kind.bounds = "above 0";
  }
  const auto own = std::ranges::find_if(table, [&](const Named& row) {
    return row.option == name && (row.command.empty() || row.command == command);
  });
  if (own != table.end() && kind.name == "TEXT") {
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
