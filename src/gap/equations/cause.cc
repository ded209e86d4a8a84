#include "gap/equations/cause.h"

#include <algorithm>

#include "statistics/robust.h"

namespace joulecast::gap {

std::vector<Modulation> modulations_of(std::span<const Window> windows) {
  std::vector<Modulation> modulations;
  const std::size_t count = windows.empty() ? 0 : windows.front().covariates.size();
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<double> known;
    for (const Window& w : windows) {
      if (std::isfinite(w.covariates[k])) known.push_back(w.covariates[k]);
    }
    if (2 * known.size() < windows.size() || std::ranges::min(known) == std::ranges::max(known)) continue;
    modulations.push_back({k, statistics::median(std::move(known))});
  }
  return modulations;
}

}  // namespace joulecast::gap
