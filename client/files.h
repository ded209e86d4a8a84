#pragma once

#include <string>

#include "base/error.h"

namespace joulecast::client {

// The bytes of a file; "-" reads standard input. Fault::not_found when it cannot be opened.
[[nodiscard]] Result<std::string> read_file(const std::string& path);

// Replaces the file. Fault::unavailable when not every byte reached the system.
[[nodiscard]] Result<void> write_file(const std::string& path, const std::string& text);

}  // namespace joulecast::client
