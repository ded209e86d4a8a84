#include "client/commands/option.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/algorithm/string/replace.hpp>
#include <cstdio>

#include "base/text.h"
#include "base/utc_time.h"

namespace joulecast::client {
namespace {

template <class Accepts>
Value number(const std::string& bounds, Accepts accepts) {
  return {.bounds = bounds,
          .check = {[bounds, accepts](std::string& text) -> std::string {
                      double value = 0;
                      if (CLI::detail::lexical_cast(text, value) && accepts(value)) return {};
                      return fmt::format("must be {}, not {}", bounds, text);
                    },
                    ""}};
}

constexpr const char* alternatives_name = "alternatives";

constexpr std::size_t date_length = 10;  // of 2024-07-18

Value time_by(Result<std::int64_t> (*parse)(const std::string& text, const std::string& option)) {
  return {.name = "TIME",
          .check = {[parse](std::string& text) -> std::string {
                      const auto utime_us = parse(text, {});
                      if (!utime_us) return utime_us.error().message;
                      text = std::to_string(*utime_us);
                      return {};
                    },
                    ""}};
}

}  // namespace

Value one_of(const std::vector<std::string>& words) {
  const std::string set = fmt::format("{{{}}}", fmt::join(words, ","));
  return {.name = set,
          .check = {[words, set](std::string& text) -> std::string {
                      if (std::ranges::find(words, text) != words.end()) return {};
                      return fmt::format("must be one of {}, not {}", set, text);
                    },
                    ""}};
}

Value between(double least, double most) {
  return number(fmt::format("{:.12g} to {:.12g}", least, most),
                [least, most](double value) { return value >= least && value <= most; });
}

Value positive() {
  return number("above 0", [](double value) { return value > 0; });
}

Value not_negative() {
  return number("at least 0", [](double value) { return value >= 0; });
}

std::string value_name(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) return {};
  std::string type = option.get_type_name();
  if (type == "FLOAT") return "NUMBER";
  return type == "INT" || type == "UINT" ? "INTEGER" : type;
}

std::string command_path(const CLI::App& app) {
  std::string path;
  for (const CLI::App* at = &app; at->get_parent() != nullptr; at = at->get_parent())
    if (!at->get_name().empty()) path = at->get_name() + (path.empty() ? "" : " " + path);
  return path;
}

void set_trait(CLI::App&, CLI::Option& option, const Value& value) {
  if (!value.name.empty()) option.type_name(value.name);
  if (!value.bounds.empty()) option.description(option.get_description() + "; " + value.bounds);
  if (!value.variable.empty()) option.envname(value.variable);
  option.transform(value.check);
}

void set_trait(CLI::App&, CLI::Option& option, Trait trait) {
  if (trait == Trait::required) option.required();
  if (trait == Trait::commas) option.delimiter(',');
}

void set_trait(CLI::App& command, CLI::Option& option, Needs needs) {
  option.needs(command.get_option(needs.option));
}

void set_trait(CLI::App& command, CLI::Option& option, Excludes excludes) {
  option.excludes(command.get_option(excludes.option));
}

CLI::App& alternatives(CLI::App& command) {
  const auto groups = command.get_subcommands([](const CLI::App* sub) { return sub->get_name().empty(); });
  if (!groups.empty()) return *groups.front();
  CLI::App* group = command.add_option_group(alternatives_name);
  group->require_option(1);
  return *group;
}

void add_examples(CLI::App& command, const char* examples) {
  command.footer("Examples:\n  " + boost::replace_all_copy<std::string>(examples, "\n", "\n  ") + "\n\n");
}

CLI::App& add_group(CLI::App& parent, const char* name, const char* help) {
  CLI::App* group = parent.add_subcommand(name, help);
  group->require_subcommand(1);
  return *group;
}

void add_example(CLI::App& command, const char* request) {
  command.add_flag_callback(
      "--example",
      [request] {
        std::puts(request);
        throw CLI::Success();
      },
      "print an example request as JSON and exit");
}

Result<std::int64_t> parse_time(const std::string& text, const std::string& option) {
  if (const auto utime_us = to_number<std::int64_t>(text); utime_us && *utime_us >= 0) return *utime_us;
  if (const auto parsed = parse_utc(text)) return *parsed;
  const bool dated = text.size() >= date_length && text[4] == '-' && text[7] == '-';
  if (dated && !parse_utc(text.substr(0, date_length)))
    return invalid(option, "there is no day " + text.substr(0, date_length));
  return invalid(option,
                 "'" + text + "' is neither " + std::string(utc_forms) + " nor microseconds since 1970");
}

Result<std::int64_t> parse_end_time(const std::string& text, const std::string& option) {
  if (const auto parsed = parse_utc_end(text)) return *parsed;
  return parse_time(text, option);
}

Value time_value() {
  return time_by(parse_time);
}

Value end_time_value() {
  return time_by(parse_end_time);
}

Exit exit_of(Fault fault) {
  switch (fault) {
    case Fault::invalid:
    case Fault::not_found:
    case Fault::conflict:
    case Fault::too_large:
    case Fault::corrupt:
      return Exit::fault;
    case Fault::infeasible:
      return Exit::infeasible;
    case Fault::stopped:
    case Fault::unavailable:
      return Exit::unreachable;
    case Fault::internal:
      break;
  }
  return Exit::internal;
}

Exit report(const Error& error) {
  std::fprintf(stderr, "joulecast: %s\n", describe(error).c_str());
  // An invalid value of an option is wrong use, also if it is detected after parsing.
  if (error.fault == Fault::invalid && error.field.starts_with("--")) return Exit::usage;
  return exit_of(error.fault);
}

}  // namespace joulecast::client
