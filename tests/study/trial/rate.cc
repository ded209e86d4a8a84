#include "tests/study/trial/rate.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace joulecast::trial {

using nlohmann::json;

constexpr double normal_95 = 1.959964;

std::array<double, 2> Rate::interval() const {
  if (tries == 0) return {0, 1};
  const double n = static_cast<double>(tries);
  const double p = value();
  const double z2 = normal_95 * normal_95;
  const double middle = (p + z2 / (2 * n)) / (1 + z2 / n);
  const double half = normal_95 * std::sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n);
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

std::string rate_text(const Rate& rate) {
  if (rate.tries == 0) return "-";
  const auto [low, high] = rate.interval();
  return fmt::format("{}/{} {:.0f} % [{:.0f}, {:.0f}]", rate.hits, rate.tries, 100 * rate.value(), 100 * low,
                     100 * high);
}

json rate_json(const Rate& rate) {
  const auto [low, high] = rate.interval();
  return {{"hits", rate.hits},
          {"of", rate.tries},
          {"rate", rate.tries > 0 ? json(rate.value()) : json()},
          {"ci", {low, high}}};
}

}  // namespace joulecast::trial
