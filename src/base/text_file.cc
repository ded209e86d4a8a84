#include "base/text_file.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

namespace joulecast {

Result<std::string> read_text(std::istream& stream, const std::string& name, std::size_t max_bytes,
                              std::size_t max_line_bytes) {
  std::string text;
  std::size_t line_begin = 0;
  std::array<char, 1 << 16> block{};
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > max_bytes)
      return fail(Fault::too_large, name, "has more than " + std::to_string(max_bytes >> 20) + " MiB");
    if (text.size() - line_begin <= max_line_bytes) continue;
    if (const auto end = text.find_last_of("\r\n"); end != std::string::npos) line_begin = end + 1;
    if (text.size() - line_begin > max_line_bytes)
      return fail(Fault::too_large, name,
                  "has a line of more than " + std::to_string(max_line_bytes >> 20) + " MiB");
  }
  if (stream.bad())
    return fail(Fault::unavailable, name, std::string("cannot be read: ") + std::strerror(errno));
  return text;
}

Result<std::string> read_text_file(const std::filesystem::path& path, std::size_t max_bytes,
                                   std::size_t max_line_bytes) {
  std::error_code unknown;  // opening it reports the fault
  const std::filesystem::file_status status = std::filesystem::status(path, unknown);
  if (std::filesystem::is_directory(status)) return invalid(path.string(), "is a folder, must be a file");
  // Opening a pipe waits for a program that writes to it.
  if (std::filesystem::is_fifo(status)) return invalid(path.string(), "is a pipe, must be a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    return fail(errno == ENOENT || errno == ENOTDIR ? Fault::not_found : Fault::unavailable, path.string(),
                std::string("cannot be opened: ") + std::strerror(errno));
  }
  return read_text(file, path.string(), max_bytes, max_line_bytes);
}

}  // namespace joulecast
