#include "client/files.h"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <system_error>

namespace joulecast::client {
namespace {

// Larger than the table of any long recording.
constexpr std::size_t max_bytes = std::size_t{1} << 30;

}  // namespace

Result<std::string> read_file(const std::string& path, std::size_t max_line_bytes) {
  if (path == "-") return read_text(std::cin, path, max_bytes, max_line_bytes);
  // A shell passes the output of a command as a pipe: <(command).
  std::error_code unknown;
  if (std::filesystem::is_fifo(path, unknown)) {
    std::ifstream stream(path, std::ios::binary);
    return read_text(stream, path, max_bytes, max_line_bytes);
  }
  return read_text_file(path, max_bytes, max_line_bytes);
}

}  // namespace joulecast::client
