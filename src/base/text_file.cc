#include "base/text_file.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

namespace joulecast {

Result<std::string> read_text(std::istream& stream, const std::string& name, std::size_t max_bytes) {
  std::string text;
  std::array<char, 1 << 16> block{};
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > max_bytes)
      return fail(Fault::too_large, name, "has more than " + std::to_string(max_bytes >> 20) + " MiB");
  }
  if (stream.bad())
    return fail(Fault::unavailable, name, std::string("cannot be read: ") + std::strerror(errno));
  return text;
}

Result<std::string> read_text_file(const std::filesystem::path& path, std::size_t max_bytes) {
  std::error_code unknown;  // opening it reports the fault
  if (std::filesystem::is_directory(path, unknown))
    return invalid(path.string(), "is a folder, must be a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    return fail(errno == ENOENT || errno == ENOTDIR ? Fault::not_found : Fault::unavailable, path.string(),
                std::string("cannot be opened: ") + std::strerror(errno));
  }
  return read_text(file, path.string(), max_bytes);
}

}  // namespace joulecast
