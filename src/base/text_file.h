#pragma once

#include <filesystem>
#include <string>

#include "base/error.h"

namespace joulecast {

// All bytes of a file. Fault::not_found where there is none, ::invalid where it is a folder, ::unavailable
// where it cannot be read.
Result<std::string> read_text_file(const std::filesystem::path& path);

}  // namespace joulecast
