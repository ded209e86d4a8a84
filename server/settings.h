#pragma once

#include <algorithm>
#include <chrono>
#include <concepts>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "server/daemon_options.h"

// The settings of joulecastd, all from the one table in settings_table.cc, which binds each to a member of
// DaemonOptions. The key "http.port" is also the flag --http-port, the environment variable
// JOULECAST_HTTP_PORT, and "port" of the object "http" in the settings file. Precedence: flag > environment >
// file > default. Unknown keys are errors wherever they come from.
namespace joulecast {

// The member of a setting, by the type of its values.
struct Target {
  enum class Type : std::uint8_t { text, integer, number, boolean, choice };
  Type type;
  std::string text;                              // the present value, as it is set
  std::function<void(std::string_view)> set;     // a text, "true" or "false", or one of the names of a choice
  std::function<void(double)> set_number = {};   // an integer or a number
  std::span<const std::string_view> names = {};  // of a choice
};
// Of a text, a list of texts, an integer, a number, milliseconds that are set in seconds, or true or false.
Target target(std::string& member);
Target target(std::vector<std::string>& member);
Target target(std::set<std::string>& member);
Target target(bool& member);
Target target(double& member);
Target target(std::chrono::milliseconds& member);
template <std::integral T>
Target target(T& member) {
  return {Target::Type::integer, std::to_string(member), {}, [&member](double value) {
            member = static_cast<T>(value);
          }};
}
// Of microseconds that are set in seconds.
Target duration(std::int64_t& us);
// Of a value that is absent at 0, set in multiples of `unit`.
Target limit(std::optional<std::int64_t>& member, double unit);
// Of an enumeration whose values, from `first` on, are in the order of the names.
template <class E>
Target choice(E& member, std::span<const std::string_view> names, int first = 0) {
  const auto index = static_cast<std::size_t>(static_cast<int>(member) - first);
  return {Target::Type::choice,
          std::string(names[index]),
          [&member, names, first](std::string_view name) {
            member = static_cast<E>(std::ranges::find(names, name) - names.begin() + first);
          },
          {},
          names};
}

struct Setting {
  std::string_view key;
  Target (*member)(DaemonOptions& options);
  double minimum = 0;  // bounds of integers and numbers, both inclusive
  double maximum = 0;
  std::string_view unit;  // empty when it has none
  std::string_view help;

  std::string flag() const;           // "--http-port"
  std::string environment() const;    // "JOULECAST_HTTP_PORT"
  std::string default_value() const;  // "8080"
};

std::span<const Setting> settings_table();

enum class Origin : std::uint8_t { default_value, file, environment, flag };
std::string_view to_string(Origin origin);

class Settings {
 public:
  // With every setting at its default.
  const DaemonOptions& options() const { return options_; }
  Origin origin(std::string_view key) const;

  // Sets one value from its text, checked against type and bounds; errors name the key as `where` spells it.
  Result<void> set(std::string_view key, std::string_view value, Origin origin, std::string_view where);

  // The JSON text of a settings file; `file` is its name for errors.
  Result<void> read_file_text(std::string_view json_text, std::string_view file);

  // The effective values with unit and origin, one a line: "http.port = 8080  # default".
  std::string print() const;

 private:
  DaemonOptions options_;
  std::map<std::string_view, Origin> origins_;  // of settings that are not at their default
};

// The action of the command line.
struct Invocation {
  enum class Action : std::uint8_t {
    run,
    help,
    version,
    check_config,
    print_config,
    print_openapi,
    print_config_schema,
    check_store,
    backup,
    restore,
    salvage
  };
  Action action = Action::run;
  std::string file;  // that the action names, where it names one
  Settings settings;
};

// Reads the command line (without the program's name), the environment ("NAME=value" each) and the file named
// by --config or JOULECAST_CONFIG. A flag is "--key value" or "--key=value". Errors: one line for each.
Result<Invocation> read_settings(const std::vector<std::string>& arguments,
                                 const std::vector<std::string>& environment);

// The process's environment in the form above.
std::vector<std::string> process_environment();

// Text of --help.
std::string settings_help();

// JSON Schema 2020-12 of the settings file, from the table; schemas/config.schema.json is this text.
std::string settings_schema();

}  // namespace joulecast
