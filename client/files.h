#pragma once

#include <string>

#include "base/error.h"

namespace joulecast::client {

// The bytes of a file; "-" reads standard input. Fault::not_found when it cannot be opened.
[[nodiscard]] Result<std::string> read_file(const std::string& path);

// Whether the file that an option names may be written: Fault::conflict of that option where there is one
// already and `force` does not say to write over it. Devices and pipes may always be written.
[[nodiscard]] Result<void> may_write(const std::string& option, const std::string& path, bool force);

// Replaces the file. Fault::unavailable when not every byte reached the system.
[[nodiscard]] Result<void> write_file(const std::string& path, const std::string& text);

}  // namespace joulecast::client
