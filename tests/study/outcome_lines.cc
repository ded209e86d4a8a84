#include "tests/study/outcome_lines.h"

#include <filesystem>
#include <nlohmann/json.hpp>

namespace joulecast::client {

Result<OutcomeLines> OutcomeLines::open(const std::string& path) {
  OutcomeLines lines;
  lines.path_ = path;
  if (path.empty()) return lines;
  if (std::filesystem::is_symlink(path))
    return fail(Fault::conflict, path, "is a symbolic link; name the file itself");
  lines.out_.open(path, std::ios::app);
  if (!lines.out_) return fail(Fault::unavailable, path, "cannot be opened for writing");
  return lines;
}

void OutcomeLines::add(const nlohmann::json& outcome) {
  if (!path_.empty()) out_ << outcome.dump() << std::endl;
}

Result<void> OutcomeLines::close() {
  if (path_.empty()) return {};
  out_.close();
  if (!out_) return fail(Fault::unavailable, path_, "not every line could be written");
  return {};
}

}  // namespace joulecast::client
