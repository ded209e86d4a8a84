#include "client/files.h"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <utility>

#include "base/text_file.h"

namespace joulecast::client {

Result<std::string> read_file(const std::string& path) {
  if (path != "-") return read_text_file(path);
  std::ostringstream text;
  if (std::cin.peek() != std::istream::traits_type::eof()) text << std::cin.rdbuf();
  if (std::cin.bad() || text.fail()) return fail(Fault::unavailable, path, "cannot be read");
  return std::move(text).str();
}

Result<void> may_write(const std::string& option, const std::string& path, bool force) {
  if (force || !std::filesystem::is_regular_file(path)) return {};
  return fail(Fault::conflict, option, path + " is there already; --force writes over it");
}

Result<void> write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) return fail(Fault::unavailable, path, "cannot be written");
  return {};
}

}  // namespace joulecast::client
