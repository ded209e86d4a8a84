#include "client/files.h"

#include <fstream>
#include <iostream>
#include <iterator>

namespace joulecast::client {

Result<std::string> read_file(const std::string& path) {
  std::ifstream file;
  if (path != "-") {
    file.open(path, std::ios::binary);
    if (!file) return fail(Fault::not_found, path, "cannot be opened");
  }
  std::istream& in = path == "-" ? std::cin : file;
  std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (in.bad()) return fail(Fault::unavailable, path, "cannot be read");
  return text;
}

Result<void> write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) return fail(Fault::unavailable, path, "cannot be written");
  return {};
}

}  // namespace joulecast::client
