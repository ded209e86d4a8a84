#include "statistics/shapley.h"

#include <bit>
#include <cmath>

namespace joulecast::statistics {

std::vector<double> shapley_shares(std::size_t n,
                                   const std::function<double(const std::vector<std::size_t>&)>& gap) {
  std::vector<double> left(std::size_t{1} << n);
  for (std::size_t set = 0; set < left.size(); ++set) {
    std::vector<std::size_t> members;
    for (std::size_t k = 0; k < n; ++k) {
      if (set >> k & 1) members.push_back(k);
    }
    left[set] = gap(members);
  }
  const auto factorial = [](std::size_t k) { return std::tgamma(static_cast<double>(k) + 1); };
  std::vector<double> share(n, 0.0);
  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t set = 0; set < left.size(); ++set) {
      if (set >> k & 1) continue;
      const auto size = static_cast<std::size_t>(std::popcount(set));
      share[k] += factorial(size) * factorial(n - size - 1) / factorial(n) *
                  (left[set] - left[set | std::size_t{1} << k]);
    }
    if (left[0] > 0) share[k] /= left[0];
  }
  return share;
}

}  // namespace joulecast::statistics
