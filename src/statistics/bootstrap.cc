#include "statistics/bootstrap.h"

#include <cmath>
#include <limits>
#include <random>

#include "statistics/robust.h"

namespace joulecast::statistics {

std::vector<std::vector<int>> bootstrap_counts(std::size_t n, int draws, std::uint64_t seed) {
  std::vector<std::vector<int>> counts(static_cast<std::size_t>(draws), std::vector<int>(n, 0));
  if (n == 0) return counts;
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<std::size_t> pick(0, n - 1);
  for (std::vector<int>& draw : counts)
    for (std::size_t k = 0; k < n; ++k) ++draw[pick(random)];
  return counts;
}

std::array<double, 2> bootstrap_interval(std::size_t blocks,
                                         const std::function<double(std::span<const int>)>& statistic,
                                         int draws) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  if (blocks < 2) return {nan, nan};
  std::vector<double> values;
  for (const std::vector<int>& draw : bootstrap_counts(blocks, draws))
    if (const double v = statistic(draw); std::isfinite(v)) values.push_back(v);
  if (values.empty()) return {nan, nan};
  return {quantile(values, 0.025), quantile(values, 0.975)};
}

}  // namespace joulecast::statistics
