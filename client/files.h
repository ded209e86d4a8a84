#pragma once

#include <string>

#include "base/error.h"
#include "base/text_file.h"

namespace joulecast::client {

// The bytes of a file, of 1 GiB at most; "-" reads standard input. Errors as read_text_file.
[[nodiscard]] Result<std::string> read_file(const std::string& path,
                                            std::size_t max_line_bytes = std::string::npos);

// The treatment of existing files that --force selects.
inline Existing existing(bool force) {
  return force ? Existing::replace : Existing::refuse;
}
inline constexpr const char* force_help = "overwrite existing files";

}  // namespace joulecast::client
