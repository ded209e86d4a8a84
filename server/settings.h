#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

// The settings of joulecastd, all from the one table in settings_table.cc. The key "http.port" is also the
// flag
// --http-port, the environment variable JOULECAST_HTTP_PORT, and "port" of the object "http" in the settings
// file. Precedence: flag > environment > file > default. Unknown keys are errors wherever they come from.
namespace joulecast {

struct Setting {
  enum class Type : std::uint8_t { text, integer, number, boolean, choice };
  std::string_view key;
  Type type = Type::text;
  std::string_view default_value;
  double minimum = 0;  // bounds of integers and numbers, both inclusive
  double maximum = 0;
  std::string_view unit;  // empty when it has none
  std::string_view help;
  std::span<const std::string_view> choices = {};  // of Type::choice

  std::string flag() const;         // "--http-port"
  std::string environment() const;  // "JOULECAST_HTTP_PORT"
};

std::span<const Setting> settings_table();

enum class Origin : std::uint8_t { default_value, file, environment, flag };
std::string_view to_string(Origin origin);

class Settings {
 public:
  // Every setting at its default.
  Settings();

  // Aborts for a key or type that is not in the table.
  const std::string& text(std::string_view key) const;
  std::int64_t integer(std::string_view key) const;
  double number(std::string_view key) const;
  bool boolean(std::string_view key) const;
  Origin origin(std::string_view key) const;

  // Sets one value from its text, checked against type and bounds; errors name the key as `where` spells it.
  Result<void> set(std::string_view key, std::string_view value, Origin origin, std::string_view where);

  // The JSON text of a settings file; `file` is its name for errors.
  Result<void> read_file_text(std::string_view json_text, std::string_view file);

  // The effective values with unit and origin, one a line: "http.port = 8080  # default".
  std::string print() const;

 private:
  struct Value {
    std::string text;
    Origin origin = Origin::default_value;
  };
  const Value& value(std::string_view key, Setting::Type type) const;
  std::map<std::string, Value, std::less<>> values_;
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
// by
// --config or JOULECAST_CONFIG. A flag is "--key value" or "--key=value". The error names every faulty value,
// one a line.
Result<Invocation> read_settings(const std::vector<std::string>& arguments,
                                 const std::vector<std::string>& environment);

// The process's environment in the form above.
std::vector<std::string> process_environment();

// Text of --help.
std::string settings_help();

// JSON Schema 2020-12 of the settings file, from the table; schemas/config.schema.json is this text.
std::string settings_schema();

}  // namespace joulecast
