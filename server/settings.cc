#include "server/settings.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/bounds.h"
#include "base/json_text.h"
#include "base/nearest_word.h"
#include "base/text_file.h"
#include "server/http/text.h"

namespace joulecast {
namespace {

using http::number_text;
using http::parse_number;

const Setting* find_setting(std::string_view key) {
  for (const Setting& setting : settings_table()) {
    if (setting.key == key) return &setting;
  }
  return nullptr;
}

template <class Name>
std::vector<std::string> all_names(Name name) {
  std::vector<std::string> names;
  for (const Setting& setting : settings_table()) names.push_back(name(setting));
  return names;
}

std::string kind(const Setting& setting) {
  switch (setting.type) {
    case Setting::Type::text:
      return "text";
    case Setting::Type::integer:
      return "integer";
    case Setting::Type::number:
      return "number";
    case Setting::Type::boolean:
      return "true|false";
    case Setting::Type::choice:
      break;
  }
  std::string choices;
  for (const auto choice : setting.choices) {
    if (!choices.empty()) choices += '|';
    choices += choice;
  }
  return choices;
}

// The constraint that `value` breaks, or nullopt.
std::optional<std::string> broken_constraint(const Setting& setting, std::string_view value) {
  const std::string shown = ", is \"" + std::string(value) + "\"";
  switch (setting.type) {
    case Setting::Type::text:
      if (value.find_first_of(std::string_view("\0\n\r", 3)) != std::string_view::npos) {
        return "must not contain line breaks";
      }
      return std::nullopt;
    case Setting::Type::boolean:
      if (value == "true" || value == "false") return std::nullopt;
      return "must be true or false" + shown;
    case Setting::Type::choice:
      if (std::find(setting.choices.begin(), setting.choices.end(), value) != setting.choices.end())
        return std::nullopt;
      return "must be one of " + kind(setting) + shown;
    case Setting::Type::integer:
    case Setting::Type::number:
      break;
  }
  std::optional<double> number;
  if (setting.type == Setting::Type::integer) {
    if (const auto whole = parse_number<std::int64_t>(value)) number = static_cast<double>(*whole);
    if (!number) return "must be an integer" + shown;
  } else {
    number = parse_number<double>(value);
    if (!number) return "must be a finite number" + shown;
  }
  if (const Bounds bounds{setting.minimum, setting.maximum}; !bounds.contain(*number))
    return out_of_bounds(*number, bounds, setting.unit);
  return std::nullopt;
}

// The text by which set() would be called for a JSON value; nullopt for values of a type the setting has not.
std::optional<std::string> text_of(const Setting& setting, const nlohmann::json& value) {
  switch (setting.type) {
    case Setting::Type::text:
    case Setting::Type::choice:
      if (value.is_string()) return value.get<std::string>();
      return std::nullopt;
    case Setting::Type::boolean:
      if (value.is_boolean()) return value.get<bool>() ? "true" : "false";
      return std::nullopt;
    case Setting::Type::integer:
      if (value.is_number_unsigned()) return std::to_string(value.get<std::uint64_t>());
      if (value.is_number_integer()) return std::to_string(value.get<std::int64_t>());
      return std::nullopt;
    case Setting::Type::number:
      if (value.is_number()) return number_text(value.get<double>());
      return std::nullopt;
  }
  return std::nullopt;
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

}  // namespace

std::string Setting::flag() const {
  std::string name = "--" + std::string(key);
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == '.' || c == '_'; }, '-');
  return name;
}

std::string Setting::environment() const {
  std::string name = "JOULECAST_";
  for (const char c : key) {
    name.push_back(c == '.' ? '_' : (c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c));
  }
  return name;
}

std::string_view to_string(Origin origin) {
  switch (origin) {
    case Origin::default_value:
      return "default";
    case Origin::file:
      return "file";
    case Origin::environment:
      return "environment";
    case Origin::flag:
      break;
  }
  return "flag";
}

Settings::Settings() {
  for (const Setting& setting : settings_table()) {
    values_.emplace(setting.key, Value{std::string(setting.default_value), Origin::default_value});
  }
}

const Settings::Value& Settings::value(std::string_view key, Setting::Type type) const {
  const Setting* setting = find_setting(key);
  const bool readable =
      setting != nullptr &&
      (setting->type == type || (setting->type == Setting::Type::choice && type == Setting::Type::text));
  if (!readable) {
    std::fprintf(stderr, "no setting %.*s of that type\n", static_cast<int>(key.size()), key.data());
    std::abort();
  }
  return values_.find(key)->second;
}

const std::string& Settings::text(std::string_view key) const {
  return value(key, Setting::Type::text).text;
}

std::int64_t Settings::integer(std::string_view key) const {
  return parse_number<std::int64_t>(value(key, Setting::Type::integer).text).value();
}

double Settings::number(std::string_view key) const {
  return parse_number<double>(value(key, Setting::Type::number).text).value();
}

bool Settings::boolean(std::string_view key) const {
  return value(key, Setting::Type::boolean).text == "true";
}

Origin Settings::origin(std::string_view key) const {
  const Setting* setting = find_setting(key);
  return value(key, setting == nullptr ? Setting::Type::text : setting->type).origin;
}

Result<void> Settings::set(std::string_view key, std::string_view value, Origin origin,
                           std::string_view where) {
  const Setting* setting = find_setting(key);
  if (setting == nullptr) {
    return invalid(std::string(where),
                   "unknown setting" + did_you_mean(key, all_names([](const Setting& each) {
                                                      return std::string(each.key);
                                                    })));
  }
  if (auto broken = broken_constraint(*setting, value))
    return invalid(std::string(where), std::move(*broken));
  values_.find(key)->second = Value{std::string(value), origin};
  return {};
}

Result<void> Settings::read_file_text(std::string_view json_text, std::string_view file) {
  auto document = parse_json(json_text);
  const std::string prefix = std::string(file) + ": ";
  if (!document) {
    return invalid(std::string(file), describe(document.error()));
  }
  if (!document->is_object()) return invalid(std::string(file), "must be a JSON object of sections");
  const std::vector<std::string> keys = all_names([](const Setting& each) { return std::string(each.key); });
  Problems problems;
  for (const auto& [section, content] : document->items()) {
    if (section == "$schema" && content.is_string()) continue;
    if (!content.is_object()) {
      problems.add(invalid(prefix + section, "must be an object such as {\"http\": {\"port\": 8080}}" +
                                                 did_you_mean(section, keys)));
      continue;
    }
    for (const auto& [name, value] : content.items()) {
      const std::string key = section + "." + name;
      const Setting* setting = find_setting(key);
      const auto text = setting == nullptr ? std::nullopt : text_of(*setting, value);
      if (setting == nullptr)
        problems.add(invalid(prefix + key, "unknown setting" + did_you_mean(key, keys)));
      else if (!text)
        problems.add(invalid(prefix + key, "must be of type " + kind(*setting)));
      else
        problems.add(set(key, *text, Origin::file, prefix + key));
    }
  }
  return problems.all();
}

std::string Settings::print() const {
  std::string text;
  for (const Setting& setting : settings_table()) {
    const Value& value = values_.find(setting.key)->second;
    std::string line = std::string(setting.key) + " = ";
    const bool quoted = setting.type == Setting::Type::text || setting.type == Setting::Type::choice;
    line += quoted ? nlohmann::json(value.text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)
                   : value.text;
    line.resize(std::max<std::size_t>(line.size() + 2, 60), ' ');
    text += line + "# " + std::string(to_string(value.origin)) +
            (setting.unit.empty() ? "" : std::string(", ").append(setting.unit)) + "\n";
  }
  return text;
}

namespace {

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

Result<const Setting*> setting_of_flag(const std::string& name) {
  const auto table = settings_table();
  const auto setting =
      std::find_if(table.begin(), table.end(), [&](const Setting& each) { return each.flag() == name; });
  if (setting != table.end()) return &*setting;
  if (name == "--config") return nullptr;
  auto known = all_names([](const Setting& each) { return each.flag(); });
  for (const auto& each : actions) known.emplace_back(each.first);
  known.emplace_back("--config");
  return invalid(name, "unknown flag" + did_you_mean(name, known));
}

Result<void> read_flags(const std::vector<std::string>& arguments, Given& given) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    const auto action = std::find_if(actions.begin(), actions.end(),
                                     [&](const auto& each) { return each.first == argument; });
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
    const auto setting = setting_of_flag(name);
    if (!setting) return tl::unexpected(setting.error());
    if (equals == std::string::npos && i + 1 == arguments.size()) return invalid(name, "needs a value");
    std::string value = equals == std::string::npos ? arguments[++i] : argument.substr(equals + 1);
    const bool repeated =
        *setting == nullptr
            ? given.config.has_value()
            : std::ranges::any_of(given.flags, [&](const Pending& each) { return each.where == name; });
    if (repeated) return invalid(name, "is given more than once");
    if (*setting == nullptr)
      given.config = std::move(value);
    else
      given.flags.push_back({std::string((*setting)->key), std::move(value), name});
  }
  return {};
}

constexpr std::string_view of_the_command_line[] = {"JOULECAST_SERVER", "JOULECAST_TOKEN",
                                                    "JOULECAST_CLIENT_CERTIFICATE", "JOULECAST_CLIENT_KEY"};

void read_environment(const std::vector<std::string>& environment, Given& given, Problems& problems) {
  const auto table = settings_table();
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
    const auto setting = std::find_if(table.begin(), table.end(),
                                      [&](const Setting& each) { return each.environment() == name; });
    if (setting == table.end()) {
      auto known = all_names([](const Setting& each) { return each.environment(); });
      known.emplace_back("JOULECAST_CONFIG");
      problems.add(invalid(name, "unknown environment variable" + did_you_mean(name, known)));
      continue;
    }
    given.variables.push_back({std::string(setting->key), std::move(value), name});
  }
}

}  // namespace

Result<Invocation> read_settings(const std::vector<std::string>& arguments,
                                 const std::vector<std::string>& environment) {
  Given given;
  if (auto done = read_flags(arguments, given); !done) return tl::unexpected(done.error());
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
  if (const Result<void> sound = problems.all(); !sound) return tl::unexpected(sound.error());
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
    std::string line = "  " + setting.flag() + " <" + kind(setting) + ">";
    line.resize(std::max<std::size_t>(line.size() + 2, 44), ' ');
    text += line + std::string(setting.help);
    text += " [" +
            (setting.default_value.empty() ? std::string("empty") : std::string(setting.default_value)) +
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
    switch (setting.type) {
      case Setting::Type::text:
        entry["type"] = "string";
        entry["default"] = setting.default_value;
        break;
      case Setting::Type::choice:
        entry["enum"] = std::vector<std::string>(setting.choices.begin(), setting.choices.end());
        entry["default"] = setting.default_value;
        break;
      case Setting::Type::boolean:
        entry["type"] = "boolean";
        entry["default"] = setting.default_value == "true";
        break;
      case Setting::Type::integer:
      case Setting::Type::number:
        entry["type"] = setting.type == Setting::Type::integer ? "integer" : "number";
        entry["default"] = number(parse_number<double>(setting.default_value).value());
        entry["minimum"] = number(setting.minimum);
        entry["maximum"] = number(setting.maximum);
        break;
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
