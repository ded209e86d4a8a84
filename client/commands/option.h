#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <concepts>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "base/error.h"

// Commands as tables of options, each bound to a member of the command's struct of options, and their exit
// codes.
namespace joulecast::client {

// The program's exit codes; part of the command line's contract.
enum class Exit : int {
  ok = 0,
  fault = 1,        // the work failed: an input was read and found wrong, missing or damaged
  usage = 2,        // the command line itself is wrong, or a value given in it
  unreachable = 3,  // server, network or disk did not answer
  infeasible = 4,   // well-formed, but nothing satisfies it
  internal = 5,     // an internal error
  warned = 6        // of check: nothing is wrong, something is suspicious
};

inline constexpr const char* exit_codes_help =
    "Exit codes:\n"
    "  0  done\n"
    "  1  the work failed: an input is wrong, missing or damaged\n"
    "  2  the command line is wrong, or a value given in it\n"
    "  3  server, network or disk could not be reached\n"
    "  4  nothing satisfies the request\n"
    "  5  an internal error\n"
    "  6  check: warnings, but no fault";

[[nodiscard]] Exit exit_of(Fault fault);

// Prints the error on standard error and returns its exit code.
Exit report(const Error& error);

// The kind of an option's value. The name is printed in the help and selects the completion in a shell
// (candidates() in table.h): "FILE.json", "ROBOT", "{usual,minimum_energy}".
struct Value {
  std::string name = {};      // empty: by the type of the member
  std::string bounds = {};    // "0 to 1", for the help; empty: none
  CLI::Validator check = {};  // of a value as text, which it may replace
  std::string variable = {};  // environment variable of the default
};

[[nodiscard]] Value one_of(const std::vector<std::string>& words);
// Both ends included.
[[nodiscard]] Value between(double least, double most);
[[nodiscard]] Value positive();
[[nodiscard]] Value not_negative();

// Files by the end of their name, "json".
[[nodiscard]] inline Value file_of(const std::string& ending) {
  return {.name = "FILE." + ending};
}
[[nodiscard]] inline Value named(const std::string& name) {
  return {.name = name};
}

enum class Trait {
  required,
  alternative,  // exactly one of the command's options with this trait is required
  commas        // values are separated by commas
};
inline constexpr Trait required = Trait::required, alternative = Trait::alternative, commas = Trait::commas;

// Relations to options that precede in the table.
struct Needs {
  const char* option;
};
struct Excludes {
  const char* option;
};

// "NUMBER", "INTEGER" or the name of the option's Value; empty for a flag.
[[nodiscard]] std::string value_name(const CLI::Option& option);

// "calibrate drive" of that subcommand; empty for the program itself.
[[nodiscard]] std::string command_path(const CLI::App& app);

// Neither a group of options nor hidden.
[[nodiscard]] inline bool is_visible_command(const CLI::App* app) {
  return !app->get_name().empty() && !app->get_group().empty();
}

void set_trait(CLI::App& command, CLI::Option& option, const Value& value);
void set_trait(CLI::App& command, CLI::Option& option, Trait trait);
void set_trait(CLI::App& command, CLI::Option& option, Needs needs);
void set_trait(CLI::App& command, CLI::Option& option, Excludes excludes);

// The group of the options with Trait::alternative.
[[nodiscard]] CLI::App& alternatives(CLI::App& command);

template <class T>
[[nodiscard]] constexpr bool is_alternative(const T& trait) {
  if constexpr (std::same_as<T, Trait>) return trait == Trait::alternative;
  return false;
}

// Adds an option or, for a bool, a flag. `name` is "--flag", "positional" or "positional,--flag". The help
// prints the default of a number and of a text.
template <class M, class... Traits>
CLI::Option* add_option(CLI::App& command, const std::string& name, M& member, const std::string& help,
                        const Traits&... traits) {
  CLI::App& app = (is_alternative(traits) || ...) ? alternatives(command) : command;
  CLI::Option* option = nullptr;
  if constexpr (std::same_as<M, bool>)
    option = app.add_flag(name, member, help);
  else
    option = app.add_option(name, member, help);
  (set_trait(command, *option, traits), ...);
  if constexpr (std::is_arithmetic_v<M> && !std::same_as<M, bool>) option->capture_default_str();
  if constexpr (std::same_as<M, std::string>)
    if (!member.empty()) option->capture_default_str();
  return option;
}

// A member of the request, or a parameter of the query, put into the options' `given` (server_answer.h).
template <class V>
struct Sent {
  const char* member;
};
using Number = Sent<double>;
using Text = Sent<std::string>;

// A line of a command's table.
template <class Options>
class Row {
 public:
  template <class C, class M, class... Traits>
  requires std::derived_from<Options, C> Row(const std::string& name, M C::*member, const std::string& help,
                                             const Traits&... traits)
      : add_([=](CLI::App& command, Options& options) {
          add_option(command, name, options.*member, help, traits...);
        }) {}

  template <class V, class... Traits>
  Row(const std::string& name, Sent<V> sent, const std::string& help, const Traits&... traits)
      : add_([=](CLI::App& command, Options& options) {
          const std::string flag = name.substr(name.find("--")), member = sent.member;
          const auto give = [&options, flag, member](const V& value) {
            options.given.push_back({flag, member, value});
          };
          [[maybe_unused]] CLI::Option* option = command.add_option_function<V>(name, give, help);
          (set_trait(command, *option, traits), ...);
        }) {}

  void add_to(CLI::App& command, Options& options) const { add_(command, options); }

 private:
  std::function<void(CLI::App&, Options&)> add_;
};

// Prints `examples`, a command line each, under the help of a command.
void add_examples(CLI::App& command, const char* examples);

// Adds a command that parses into an Options of its own and then runs. An error of `run` is printed and gives
// the exit code. Every line of `examples` is tested with placeholders such as amr.json and history.db.
template <class Options>
CLI::App* add_command(CLI::App& parent, Exit& exit, const char* name, const char* help,
                      Result<Exit> (*run)(Options&), const std::vector<Row<Options>>& rows,
                      const char* examples) {
  auto options = std::make_shared<Options>();
  CLI::App* command = parent.add_subcommand(name, help);
  for (const Row<Options>& row : rows) row.add_to(*command, *options);
  add_examples(*command, examples);
  command->callback([options, run, command, &exit] {
    if (!command->get_subcommands().empty()) return;  // a subcommand runs instead
    Result<Exit> done = run(*options);
    if constexpr (requires { options->logs; }) {
      if (!done && done.error().field == "log")
        done.error().field = fmt::format("{}", fmt::join(options->logs, ", "));
    }
    exit = done ? *done : report(done.error());
  });
  return command;
}

// Adds a command that has only subcommands.
[[nodiscard]] CLI::App& add_group(CLI::App& parent, const char* name, const char* help);

// The flag --example: prints a request that the command accepts, and exits.
void add_example(CLI::App& command, const char* request);

// Microseconds since 1970, from such a number or from UTC as 2024-07-18T09:10:45[.5]Z; errors name `option`.
[[nodiscard]] Result<std::int64_t> parse_time(const std::string& text, const std::string& option);

// The exclusive end of a period; for a date alone the next midnight, so that the period includes that day.
[[nodiscard]] Result<std::int64_t> parse_end_time(const std::string& text, const std::string& option);

// A time of an option, which becomes microseconds as text by parse_time() or parse_end_time().
[[nodiscard]] Value time_value();
[[nodiscard]] Value end_time_value();

inline constexpr const char
    *from_help = "started at or after: 2024-07-18, 2024-07-18T09:10:45Z or microseconds since 1970",
    *to_help = "started before, in the same forms; a date without a time includes that day";

}  // namespace joulecast::client
