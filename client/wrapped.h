#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace joulecast::client {

// Columns of the terminal at the file descriptor `file`; `otherwise` if it is no terminal.
[[nodiscard]] std::size_t terminal_columns(int file, std::size_t otherwise);
// Those of standard output, 60 to 100; 100 where it is no terminal, for equal files.
[[nodiscard]] std::size_t help_width();

// `text` in lines of at most `width` columns, each but the first indented by `indent` blanks. Line breaks of
// `text` are kept; a word longer than a line has a line of its own.
[[nodiscard]] std::string wrapped(std::string_view text, std::size_t width, std::size_t indent = 0);

}  // namespace joulecast::client
