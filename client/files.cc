#include "client/files.h"

#include <iostream>

#include "base/text_file.h"

namespace joulecast::client {
namespace {

// Larger than the table of any long recording.
constexpr std::size_t max_bytes = std::size_t{1} << 30;

}  // namespace

Result<std::string> read_file(const std::string& path) {
  return path == "-" ? read_text(std::cin, path, max_bytes) : read_text_file(path, max_bytes);
}

}  // namespace joulecast::client
