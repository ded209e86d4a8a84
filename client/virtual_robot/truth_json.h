#pragma once

#include <string>
#include <vector>

#include "client/virtual_robot/simulate.h"

namespace joulecast::virtual_robot {

// The injected truth as JSON: per robot its effects with strengths, the world's shapes, and per
// mission the true energies [J].
[[nodiscard]] std::string truth_json(const std::vector<Truth>& truths);

}  // namespace joulecast::virtual_robot
