#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <string>

#include "base/error.h"

namespace joulecast {

inline constexpr std::size_t max_text_file_bytes = std::size_t{64} << 20;

// All bytes of a file. Fault::not_found where the file does not exist, ::invalid where it is no file,
// ::too_large where it holds more than `max_bytes` or never ends, or a line has more than `max_line_bytes`,
// ::unavailable where it cannot be read.
Result<std::string> read_text_file(const std::filesystem::path& path,
                                   std::size_t max_bytes = max_text_file_bytes,
                                   std::size_t max_line_bytes = std::string::npos);

// The same of an open stream; `name` names it in errors.
Result<std::string> read_text(std::istream& stream, const std::string& name, std::size_t max_bytes,
                              std::size_t max_line_bytes = std::string::npos);

}  // namespace joulecast
