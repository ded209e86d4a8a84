#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

namespace joulecast::http {

struct Target {
  std::vector<std::string> segments;  // of the path, decoded one by one: "%2F" stays inside its segment
  std::vector<std::pair<std::string, std::string>> query;
};

// Splits the origin form "/a/b?x=1" of a request target; a fragment is an error, like a repeated query key.
// The absolute form is accepted, its authority ignored. Errors name the offending key or segment.
Result<Target> parse_target(std::string_view target);

}  // namespace joulecast::http
