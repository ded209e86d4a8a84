#include "base/text_file.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <system_error>
#include <utility>

namespace joulecast {

Result<std::string> read_text_file(const std::filesystem::path& path) {
  std::error_code unknown;  // what is unknown of it, opening tells
  if (std::filesystem::is_directory(path, unknown))
    return invalid(path.string(), "is a folder, must be a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    return fail(errno == ENOENT || errno == ENOTDIR ? Fault::not_found : Fault::unavailable, path.string(),
                std::string("cannot be opened: ") + std::strerror(errno));
  }
  std::ostringstream text;
  // Only where there is a first byte: an empty file is no failure.
  if (file.peek() != std::ifstream::traits_type::eof()) text << file.rdbuf();
  if (file.bad() || text.fail())
    return fail(Fault::unavailable, path.string(), std::string("cannot be read: ") + std::strerror(errno));
  return std::move(text).str();
}

}  // namespace joulecast
