#include "statistics/robust.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace joulecast::statistics {

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

double quantile(std::vector<double> values, double fraction) {
  const double place = fraction * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(below);
  std::ranges::nth_element(values, at);
  const double low = *at;
  if (below + 1 == values.size()) return low;
  return low + (place - static_cast<double>(below)) * (*std::min_element(at + 1, values.end()) - low);
}

double spread_about_zero(std::span<const double> values) {
  if (values.empty()) return 0;
  std::vector<double> sizes(values.size());
  std::ranges::transform(values, sizes.begin(), [](double v) { return std::fabs(v); });
  const auto kept =
      std::max<std::size_t>(1, static_cast<std::size_t>(0.9 * static_cast<double>(sizes.size())));
  const auto end = sizes.begin() + static_cast<std::ptrdiff_t>(kept);
  std::ranges::nth_element(sizes, end - 1);
  // The mean of |z| below its quantile of 90 %, z standard normal, is 2 (phi(0) - phi(1.645))/0.9 = 0.6573.
  return std::accumulate(sizes.begin(), end, 0.0) / static_cast<double>(kept) / 0.6573;
}

double huber_weight(double residual, double spread, double bound) {
  const double size = std::fabs(residual);
  return size <= bound * spread ? 1.0 : bound * spread / size;
}

}  // namespace joulecast::statistics
