#include "gap/equations/cause.h"

#include <algorithm>

#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr double near_zero = 0.5;  // of the range of a covariate

}  // namespace

double centre_of(std::vector<double> known) {
  const auto [least, most] = std::ranges::minmax(known);
  const bool amount = least >= 0 && least < near_zero * (most - least);
  return amount ? 0.0 : statistics::median(std::move(known));
}

std::vector<Modulation> modulations_of(std::span<const Window> windows) {
  std::vector<Modulation> modulations;
  const std::size_t count = windows.empty() ? 0 : windows.front().covariates.size();
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<double> known;
    for (const Window& w : windows)
      if (std::isfinite(w.covariates[k])) known.push_back(w.covariates[k]);
    if (2 * known.size() < windows.size()) continue;
    if (std::ranges::min(known) == std::ranges::max(known)) continue;
    modulations.push_back({k, centre_of(std::move(known))});
  }
  return modulations;
}

}  // namespace joulecast::gap
