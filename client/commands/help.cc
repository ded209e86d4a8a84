#include "client/commands/help.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/algorithm/string/replace.hpp>
#include <cstdio>
#include <memory>
#include <new>
#include <utility>
#include <vector>

#include "base/nearest_word.h"
#include "client/wrapped.h"

namespace joulecast::client {
namespace {

std::vector<std::string> names_of_options(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const auto& name : option->get_lnames()) names.push_back("--" + name);
  for (const CLI::App* group :
       app.get_subcommands([](const CLI::App* sub) { return sub->get_name().empty(); }))
    for (auto& name : names_of_options(*group)) names.push_back(std::move(name));
  return names;
}

std::vector<std::string> names_of_commands(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* sub : app.get_subcommands(is_visible_command)) names.push_back(sub->get_name());
  return names;
}

bool takes_words(const CLI::App& app) {
  return std::ranges::any_of(app.get_options(),
                             [](const CLI::Option* option) { return option->get_positional(); });
}

// An argument that was not accepted explains more than the option that is missing because of it.
std::string about_rest(const CLI::App& app, const std::vector<std::string>& rest) {
  const auto commands = names_of_commands(app);
  const bool takes_command = !commands.empty() && !takes_words(app);
  // An unknown command also explains its unknown options.
  if (takes_command && !rest.front().starts_with("-"))
    return "has no command " + rest.front() + did_you_mean(rest.front(), commands);
  const auto option = std::ranges::find_if(rest, [](const std::string& w) { return w.starts_with("-"); });
  if (option != rest.end()) {
    const std::string name = option->substr(0, option->find('='));
    return "has no option " + name + did_you_mean(name, names_of_options(app));
  }
  return "does not accept " + rest.front();
}

const CLI::App& program_of(const CLI::App& app) {
  return app.get_parent() == nullptr ? app : program_of(*app.get_parent());
}

}  // namespace

std::string HelpFormatter::row(const std::string& left, const std::string& text) const {
  const std::size_t column = get_column_width();
  std::string line = "  " + left;
  if (line.size() + 2 > column) {
    line += '\n' + std::string(column, ' ');
  } else {
    line.resize(column, ' ');
  }
  return line + wrapped(text, width_, column) + '\n';
}

std::string HelpFormatter::make_usage(const CLI::App* app, std::string) const {
  const std::string path = command_path(*app);
  std::string usage =
      CLI::Formatter::make_usage(app, program_of(*app).get_name() + (path.empty() ? "" : " " + path));
  if (names_of_commands(*app).empty()) usage = usage.substr(0, usage.find(" [" + get_label("SUBCOMMAND")));
  return '\n' + usage + (usage.ends_with('\n') ? "" : "\n");
}

std::string HelpFormatter::make_description(const CLI::App* app) const {
  return wrapped(app->get_description(), width_) + '\n';
}

// A group of options of which exactly one is required.
std::string HelpFormatter::make_expanded(const CLI::App* group) const {
  std::string out = "\nOne of these options:\n";
  for (const CLI::Option* option : group->get_options())
    if (option != group->get_help_ptr()) out += make_option(option, false);
  return out;
}

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
  const std::string value = value_name(*option);
  std::string left = is_positional ? option->get_name(true, false) : option->get_name(false, true);
  if (const std::size_t comma = left.find(','); comma != std::string::npos) left.insert(comma + 1, " ");
  if (!value.empty()) left += ' ' + value;
  if (option->get_expected_max() == CLI::detail::expected_max_vector_size) left += " ...";
  if (!is_positional && option->get_positional())
    return row(left, "the same as the argument " + option->get_name(true, false));
  std::string more = option->get_required() ? "required" : "";
  if (!option->get_default_str().empty())
    more += (more.empty() ? "default " : "; default ") + option->get_default_str();
  return row(left, option->get_description() + (more.empty() ? "" : " (" + more + ")"));
}

std::string HelpFormatter::make_subcommand(const CLI::App* sub) const {
  return row(sub->get_name(), sub->get_description());
}

std::string HelpFormatter::make_footer(const CLI::App* app) const {
  return app->get_footer() +
         (app->get_parent() == nullptr ? exit_codes_help
                                       : "Exit codes: " + program_of(*app).get_name() + " --help") +
         '\n';
}

std::string wrong_use(const CLI::App& program, const CLI::ParseError& error) {
  const CLI::App* app = &program;
  while (!app->get_subcommands().empty()) app = app->get_subcommands().front();
  const std::string path = command_path(*app),
                    command = program.get_name() + (path.empty() ? "" : " " + path);
  std::string text = error.what();
  const auto rest = app->remaining(false);
  const bool missing = error.get_name() == "RequiredError" || error.get_name() == "RequiresError";
  if (!rest.empty() && (missing || error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError))) {
    text = about_rest(*app, rest);
  } else if (missing && text.starts_with("A subcommand")) {
    text = fmt::format("requires a command: {}", fmt::join(names_of_commands(*app), ", "));
  } else if (const auto list = text.find('['); missing && text.starts_with("Exactly 1")) {
    text = "requires exactly one of " +
           boost::replace_all_copy(text.substr(list + 1, text.find(']') - list - 1), ",", ", ");
  } else if (error.get_name() == "ArgumentMismatch" || error.get_name() == "ConversionError") {
    // "--robot: 1 required TEXT missing"; "Could not convert: --length = three".
    const std::size_t dashes = text.find("--");
    const std::string name =
        dashes == std::string::npos ? "" : text.substr(dashes, text.find_first_of(": =", dashes) - dashes);
    const CLI::Option* option = name.empty() ? nullptr : app->get_option_no_throw(name);
    const std::string kind = option == nullptr ? "" : value_name(*option);
    const std::size_t equals = text.find(" = ");
    if (!kind.empty())
      text = name + " requires " + kind +
             (equals == std::string::npos ? "" : ", not " + text.substr(equals + 3));
  }
  return fmt::format("{}: {}\n{} --help lists the valid arguments\n", command, text, command);
}

void prepare(CLI::App& program, const std::string& version) {
  program.formatter(std::make_shared<HelpFormatter>(help_width()));
  program.get_help_ptr()->description("print this help and exit");
  program.set_version_flag("--version", version, "print the version and exit");
  program.require_subcommand(1);
}

int run(CLI::App& program, int argc, char** argv, const Exit& exit) {
  // `joulecast help missions` as `joulecast missions --help`.
  std::vector<std::string> words(argv + 1, argv + argc);
  if (!words.empty() && words.front() == "help") {
    words.erase(words.begin());
    words.emplace_back("--help");
  }
  std::ranges::reverse(words);  // as the parser takes them
  try {
    program.parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    // Help and version come this way too, with code 0; every other parse error is wrong use.
    if (error.get_exit_code() == 0) return program.exit(error);
    std::fputs(wrong_use(program, error).c_str(), stderr);
    return static_cast<int>(Exit::usage);
  } catch (const std::bad_alloc&) {
    return static_cast<int>(report({Fault::too_large, "", "needs more memory than there is"}));
  }
  return static_cast<int>(exit);
}

}  // namespace joulecast::client
