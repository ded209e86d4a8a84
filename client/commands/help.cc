#include "client/commands/help.h"

#include "client/commands/option.h"
#include "client/wrapped.h"

namespace joulecast::client {

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
  const CLI::App* program = app;
  while (program->get_parent() != nullptr) program = program->get_parent();
  return '\n' + CLI::Formatter::make_usage(app, program->get_name() + (path.empty() ? "" : " " + path));
}

std::string HelpFormatter::make_description(const CLI::App* app) const {
  return wrapped(app->get_description(), width_) + '\n';
}

// A group of options of which exactly one is required.
std::string HelpFormatter::make_expanded(const CLI::App* group) const {
  std::string out = "\nOne of these:\n";
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
  std::string more = option->get_required() ? "required" : "";
  if (!option->get_default_str().empty())
    more += (more.empty() ? "default " : "; default ") + option->get_default_str();
  return row(left, option->get_description() + (more.empty() ? "" : " (" + more + ")"));
}

std::string HelpFormatter::make_subcommand(const CLI::App* sub) const {
  return row(sub->get_name(), sub->get_description());
}

std::string HelpFormatter::make_footer(const CLI::App* app) const {
  return app->get_footer() + '\n';
}

}  // namespace joulecast::client
