#pragma once

#include <fstream>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/error.h"

namespace joulecast::client {

// Adds one line of JSON to a file as each case ends, so that the results of a stopped trial are kept.
class OutcomeLines {
 public:
  // Nothing is written for an empty path. Fault::unavailable when the file cannot be opened.
  static Result<OutcomeLines> open(const std::string& path);
  void add(const nlohmann::json& outcome);
  // Fault::unavailable when not every line reached the system.
  Result<void> close();

 private:
  std::string path_;
  std::ofstream out_;
};

}  // namespace joulecast::client
