#pragma once

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "base/error.h"

namespace joulecast {

// All bytes of a file. Fault::not_found where there is none, where it is a folder, or where it cannot be
// read.
inline Result<std::string> read_text_file(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    return fail(Fault::not_found, path.string(), "is a folder, must be a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(Fault::not_found, path.string(), "cannot be opened");
  std::ostringstream text;
  // Only where there is a first byte: an empty file is no failure.
  if (file.peek() != std::ifstream::traits_type::eof()) text << file.rdbuf();
  if (file.bad() || text.fail()) return fail(Fault::not_found, path.string(), "cannot be read");
  return std::move(text).str();
}

}  // namespace joulecast
