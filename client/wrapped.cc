#include "client/wrapped.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>

namespace joulecast::client {

std::size_t terminal_columns(int file, std::size_t otherwise) {
  winsize size{};
  return ioctl(file, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : otherwise;
}

std::size_t help_width() {
  constexpr std::size_t least = 60, most = 100;
  return std::clamp(terminal_columns(STDOUT_FILENO, most), least, most);
}

std::string wrapped(std::string_view text, std::size_t width, std::size_t indent) {
  std::string out;
  std::size_t column = indent;
  bool fresh = true;  // nothing on this line yet
  const auto turn = [&] {
    out += '\n' + std::string(indent, ' ');
    column = indent;
    fresh = true;
  };
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of(" \n"), text.size());
    const std::string_view word = text.substr(0, end);
    if (!word.empty()) {
      if (!fresh && column + 1 + word.size() > width) turn();
      if (!fresh) out += ' ';
      column += word.size() + (fresh ? 0 : 1);
      out += word;
      fresh = false;
    }
    if (end < text.size() && text[end] == '\n') turn();
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

}  // namespace joulecast::client
