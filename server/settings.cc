#include "server/settings.h"

#include <fmt/format.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "base/bounds.h"
#include "base/json_number.h"
#include "base/json_text.h"
#include "base/nearest_word.h"
#include "base/text_file.h"
#include "base/try.h"
#include "server/http/text.h"

namespace joulecast {
namespace {

using http::number_text;

// The setting of that name in the file, as a flag or in the environment; else an error that suggests one.
// `others`: names that are no settings.
template <class Name>
Result<const Setting*> setting_called(std::string_view name, Name name_of, const char* what,
                                      const std::vector<std::string_view>& others = {}) {
  std::vector<std::string> known;
  for (const Setting& each : settings_table()) {
    known.emplace_back(std::invoke(name_of, each));
    if (known.back() == name) return &each;
  }
  known.insert(known.end(), others.begin(), others.end());
  return invalid(std::string(name), fmt::format("unknown {}{}", what, did_you_mean(name, known)));
}

using Type = Target::Type;

std::string joined(const auto& texts) {
  return fmt::format("{}", fmt::join(texts, ","));
}

std::string kind(const Target& member) {
  static constexpr const char* kinds[] = {"text", "integer", "number", "true|false"};
  if (member.type != Type::choice) return kinds[static_cast<std::size_t>(member.type)];
  return fmt::format("{}", fmt::join(member.names, "|"));
}

// Member of the options that no one reads, for types and defaults.
Target default_member(const Setting& setting) {
  static DaemonOptions defaults;
  return setting.member(defaults);
}

// Sets a member, or returns the constraint that `value` breaks.
std::optional<std::string> put(const Setting& setting, std::string_view value, const Target& member) {
  const std::string shown = ", is \"" + std::string(value) + "\"";
  if (member.type == Type::integer || member.type == Type::number) {
    const bool whole = member.type == Type::integer;
    const auto number =
        whole ? std::optional<double>(to_number<std::int64_t>(value)) : to_number<double>(value);
    if (!number) return (whole ? "must be an integer" : "must be a finite number") + shown;
    if (const Bounds bounds{setting.minimum, setting.maximum}; !bounds.contain(*number))
      return out_of_bounds(*number, bounds, setting.unit);
    member.set_number(*number);
    return std::nullopt;
  }
  if (member.type == Type::text &&
      value.find_first_of(std::string_view("\0\n\r", 3)) != std::string_view::npos)
    return "must not contain line breaks";
  if (member.type == Type::boolean && value != "true" && value != "false")
    return "must be true or false" + shown;
  if (member.type == Type::choice && std::ranges::find(member.names, value) == member.names.end())
    return "must be one of " + kind(member) + shown;
  member.set(value);
  return std::nullopt;
}

// The text by which set() would be called for a JSON value; nullopt for values of a type the setting has not.
std::optional<std::string> text_in_file(Type type, const nlohmann::json& value) {
  if (type == Type::text || type == Type::choice)
    return value.is_string() ? std::optional(value.get<std::string>()) : std::nullopt;
  if (type == Type::boolean) return value.is_boolean() ? std::optional(value.dump()) : std::nullopt;
  if (type == Type::integer) return value.is_number_integer() ? std::optional(value.dump()) : std::nullopt;
  return value.is_number() ? std::optional(number_text(value.get<double>())) : std::nullopt;
}

// All errors as one, each on its own line.
class Problems {
 public:
  void add(const Result<void>& done) {
    if (done) return;
    if (!error_)
      error_ = done.error();
    else
      error_->message += '\n' + describe(done.error());
  }
  Result<void> all() const { return error_ ? Result<void>(tl::unexpected(*error_)) : Result<void>(); }

 private:
  std::optional<Error> error_;
};

struct Pending {
  std::string key;
  std::string value;
  std::string where;
};

using Action = Invocation::Action;

constexpr std::array<std::pair<std::string_view, Action>, 10> actions{{
    {"--help", Action::help},
    {"--version", Action::version},
    {"--check-config", Action::check_config},
    {"--print-config", Action::print_config},
    {"--print-openapi", Action::print_openapi},
    {"--print-config-schema", Action::print_config_schema},
    {"--check-store", Action::check_store},
    {"--backup", Action::backup},
    {"--restore", Action::restore},
    {"--salvage", Action::salvage},
}};

bool names_a_file(Action action) {
  return action == Action::backup || action == Action::restore || action == Action::salvage;
}

// The values of flags and environment before they are in force.
struct Given {
  std::optional<Action> action;
  std::string file;  // of the action
  std::optional<std::string> config;
  std::vector<Pending> flags, variables;
};

// Null: of the settings file.
Result<const Setting*> setting_of_flag(const std::string& name) {
  if (name == "--config") return nullptr;
  std::vector<std::string_view> others;
  for (const auto& each : actions) others.push_back(each.first);
  others.push_back("--config");
  return setting_called(name, &Setting::flag, "flag", others);
}

Result<void> read_flags(const std::vector<std::string>& arguments, Given& given) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    const auto action = std::ranges::find(actions, argument, &std::pair<std::string_view, Action>::first);
    if (action != actions.end()) {
      if (given.action.value_or(action->second) != action->second)
        return invalid(argument, "only one such command can be given");
      given.action = action->second;
      if (names_a_file(action->second)) {
        if (i + 1 == arguments.size() || arguments[i + 1].empty()) return invalid(argument, "needs a file");
        given.file = arguments[++i];
      }
      continue;
    }
    const auto equals = argument.find('=');
    const std::string name = argument.substr(0, equals);
    TRY_ASSIGN(const auto setting, setting_of_flag(name));
    if (equals == std::string::npos && i + 1 == arguments.size()) return invalid(name, "needs a value");
    std::string value = equals == std::string::npos ? arguments[++i] : argument.substr(equals + 1);
    const bool repeated =
        setting == nullptr
            ? given.config.has_value()
            : std::ranges::any_of(given.flags, [&](const Pending& each) { return each.where == name; });
    if (repeated) return invalid(name, "is given more than once");
    if (setting == nullptr)
      given.config = std::move(value);
    else
      given.flags.push_back({std::string(setting->key), std::move(value), name});
  }
  return {};
}

constexpr std::string_view of_the_command_line[] = {"JOULECAST_SERVER", "JOULECAST_TOKEN",
                                                    "JOULECAST_CLIENT_CERTIFICATE", "JOULECAST_CLIENT_KEY"};

void read_environment(const std::vector<std::string>& environment, Given& given, Problems& problems) {
  for (const std::string& entry : environment) {
    if (!entry.starts_with("JOULECAST_")) continue;
    const auto equals = entry.find('=');
    const std::string name = entry.substr(0, equals);
    std::string value = equals == std::string::npos ? "" : entry.substr(equals + 1);
    if (name == "JOULECAST_CONFIG") {
      if (!given.config) given.config = std::move(value);
      continue;
    }
    if (std::ranges::find(of_the_command_line, name) != std::end(of_the_command_line)) continue;
    const auto setting =
        setting_called(name, &Setting::environment, "environment variable", {"JOULECAST_CONFIG"});
    if (setting)
      given.variables.push_back({std::string((*setting)->key), std::move(value), name});
    else
      problems.add(tl::unexpected(setting.error()));
  }
}

}  // namespace

Target target(std::string& member) {
  return {Type::text, member, [&member](std::string_view value) { member = value; }};
}

Target target(std::vector<std::string>& member) {
  return {Type::text, joined(member), [&member](std::string_view value) { member = http::listed(value); }};
}

Target target(std::set<std::string>& member) {
  return {Type::text, joined(member), [&member](std::string_view value) {
            const std::vector<std::string> list = http::listed(value);
            member = {list.begin(), list.end()};
          }};
}

Target target(bool& member) {
  return {Type::boolean, member ? "true" : "false",
          [&member](std::string_view value) { member = value == "true"; }};
}

Target target(double& member) {
  return {Type::number, number_text(member), {}, [&member](double value) { member = value; }};
}

Target target(std::chrono::milliseconds& member) {
  return {Type::number, number_text(static_cast<double>(member.count()) / 1e3), {}, [&member](double value) {
            member = std::chrono::milliseconds(static_cast<std::int64_t>(value * 1e3));
          }};
}

Target duration(std::int64_t& us) {
  return {Type::number, number_text(static_cast<double>(us) / 1e6), {}, [&us](double value) {
            us = static_cast<std::int64_t>(value * 1e6);
          }};
}

Target limit(std::optional<std::int64_t>& member, double unit) {
  const std::int64_t value = member.value_or(0);
  const bool whole = unit == 1;
  return {whole ? Type::integer : Type::number,
          whole ? std::to_string(value) : number_text(static_cast<double>(value) / unit),
          {},
          [&member, unit](double given) {
            member.reset();
            if (given > 0) member = static_cast<std::int64_t>(given * unit);
          }};
}

std::string Setting::flag() const {
  std::string name = "--" + std::string(key);
  std::ranges::replace_if(
      name, [](char c) { return c == '.' || c == '_'; }, '-');
  return name;
}

std::string Setting::environment() const {
  std::string name = "JOULECAST_";
  for (const char c : key)
    name.push_back(c == '.' ? '_' : (c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c));
  return name;
}

std::string Setting::default_value() const {
  return default_member(*this).text;
}

std::string_view to_string(Origin origin) {
  constexpr std::string_view names[] = {"default", "file", "environment", "flag"};
  return names[static_cast<std::size_t>(origin)];
}

Origin Settings::origin(std::string_view key) const {
  const auto found = origins_.find(key);
  return found == origins_.end() ? Origin::default_value : found->second;
}

Result<void> Settings::set(std::string_view key, std::string_view value, Origin origin,
                           std::string_view where) {
  const auto named = [&](Error error) {
    error.field = where;
    return error;
  };
  TRY_ASSIGN(const Setting* setting, setting_called(key, &Setting::key, "setting").map_error(named));
  if (auto broken = put(*setting, value, setting->member(options_)))
    return invalid(std::string(where), std::move(*broken));
  origins_[setting->key] = origin;
  return {};
}

Result<void> Settings::read_file_text(std::string_view json_text, std::string_view file) {
  auto document = parse_json(json_text);
  const std::string prefix = std::string(file) + ": ";
  if (!document) return invalid(std::string(file), describe(document.error()));
  if (!document->is_object()) return invalid(std::string(file), "must be a JSON object of sections");
  Problems problems;
  for (const auto& [section, content] : document->items()) {
    if (section == "$schema" && content.is_string()) continue;
    if (!content.is_object()) {
      problems.add(invalid(prefix + section, "must be an object such as {\"http\": {\"port\": 8080}}" +
                                                 did_you_mean(section, settings_table(), &Setting::key)));
      continue;
    }
    for (const auto& [name, value] : content.items()) {
      const std::string key = section + "." + name;
      const auto setting = setting_called(key, &Setting::key, "setting");
      const Target member = setting ? default_member(**setting) : Target{};
      if (const auto text = setting ? text_in_file(member.type, value) : std::optional(std::string()))
        problems.add(set(key, *text, Origin::file, prefix + key));
      else
        problems.add(invalid(prefix + key, "must be of type " + kind(member)));
    }
  }
  return problems.all();
}

std::string Settings::print() const {
  std::string text;
  DaemonOptions options = options_;
  for (const Setting& setting : settings_table()) {
    const Target member = setting.member(options);
    std::string line = std::string(setting.key) + " = ";
    const bool quoted = member.type == Type::text || member.type == Type::choice;
    line += quoted ? json_text(nlohmann::json(member.text)) : member.text;
    line.resize(std::max<std::size_t>(line.size() + 2, 60), ' ');
    text += line + "# " + std::string(to_string(origin(setting.key))) +
            (setting.unit.empty() ? "" : std::string(", ").append(setting.unit)) + "\n";
  }
  return text;
}

Result<Invocation> read_settings(const std::vector<std::string>& arguments,
                                 const std::vector<std::string>& environment) {
  Given given;
  TRY(read_flags(arguments, given));
  Problems problems;
  read_environment(environment, given, problems);
  Invocation invocation;
  if (given.action) invocation.action = *given.action;
  invocation.file = given.file;
  if (invocation.action == Action::help || invocation.action == Action::version) return invocation;
  if (given.config) {
    const auto text = read_text_file(*given.config);
    problems.add(text ? invocation.settings.read_file_text(*text, *given.config)
                      : tl::unexpected(text.error()));
  }
  for (const auto& [key, value, where] : given.variables)
    problems.add(invocation.settings.set(key, value, Origin::environment, where));
  for (const auto& [key, value, where] : given.flags)
    problems.add(invocation.settings.set(key, value, Origin::flag, where));
  TRY(problems.all());
  return invocation;
}

std::vector<std::string> process_environment() {
  std::vector<std::string> entries;
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) entries.emplace_back(*entry);
  return entries;
}

std::string settings_help() {
  std::string text =
      "joulecastd: accounts for and forecasts the energy of a fleet of differential-drive robots\n\n"
      "usage: joulecastd [--config FILE] [--SETTING VALUE ...] [COMMAND]\n\n"
      "commands\n"
      "  --check-config         check the settings and the robot files, and exit\n"
      "  --print-config         print the effective settings with their origin and exit\n"
      "  --print-config-schema  print the JSON Schema of the settings file and exit\n"
      "  --print-openapi        print the OpenAPI document and exit\n"
      "  --check-store          check the history: pages, references, ledgers, recordings; exit code 3: "
      "damaged\n"
      "  --backup FILE          copy the history into a new file, also while a daemon runs\n"
      "  --restore FILE         replace the history by a copy; the previous file is renamed and kept\n"
      "  --salvage FILE         copy the readable part of a damaged history into a new file\n"
      "  --help, --version\n\n"
      "A setting comes from flag > environment > file > default; --http-port is JOULECAST_HTTP_PORT in the\n"
      "environment and {\"http\": {\"port\": ...}} in the file.\n\n"
      "settings\n";
  for (const Setting& setting : settings_table()) {
    std::string line = "  " + setting.flag() + " <" + kind(default_member(setting)) + ">";
    line.resize(std::max<std::size_t>(line.size() + 2, 44), ' ');
    text += line + std::string(setting.help);
    const std::string value = setting.default_value();
    text += " [" + (value.empty() ? "empty" : value) +
            (setting.unit.empty() ? "" : std::string(" ").append(setting.unit)) + "]\n";
  }
  text +=
      "\nexit codes\n"
      "  0  stopped on request, or printed the requested output\n"
      "  1  the service could not start; its log contains the setting at fault\n"
      "  2  the command line, an environment variable or the settings file is wrong\n"
      "  3  --check-store found the history damaged\n";
  return text;
}

std::string settings_schema() {
  using nlohmann::ordered_json;
  ordered_json sections = ordered_json::object();
  sections["$schema"] = {{"type", "string"}};
  for (const Setting& setting : settings_table()) {
    const auto dot = setting.key.find('.');
    auto& section = sections[std::string(setting.key.substr(0, dot))];
    if (section.is_null()) {
      section["type"] = "object";
      section["additionalProperties"] = false;
      section["properties"] = ordered_json::object();
    }
    ordered_json entry;
    entry["description"] = std::string(setting.help) +
                           (setting.unit.empty() ? "" : std::string(" [").append(setting.unit).append("]"));
    const auto number = [](double bound) {
      return bound == static_cast<double>(static_cast<std::int64_t>(bound))
                 ? ordered_json(static_cast<std::int64_t>(bound))
                 : ordered_json(bound);
    };
    const Target member = default_member(setting);
    const Type type = member.type;
    if (type == Type::choice)
      entry["enum"] = member.names;
    else
      entry["type"] = type == Type::text ? "string" : type == Type::boolean ? "boolean" : kind(member);
    const std::string value = setting.default_value();
    if (type == Type::text || type == Type::choice)
      entry["default"] = value;
    else if (type == Type::boolean)
      entry["default"] = value == "true";
    else {
      entry["default"] = number(std::stod(value));
      entry["minimum"] = number(setting.minimum);
      entry["maximum"] = number(setting.maximum);
    }
    section["properties"][std::string(setting.key.substr(dot + 1))] = std::move(entry);
  }
  ordered_json schema;
  schema["$schema"] = "https://json-schema.org/draft/2020-12/schema";
  schema["$id"] = "https://joulecast.invalid/schemas/config.schema.json";
  schema["title"] = "Settings file of joulecastd";
  schema["type"] = "object";
  schema["additionalProperties"] = false;
  schema["properties"] = std::move(sections);
  return schema.dump(2) + "\n";
}

}  // namespace joulecast
