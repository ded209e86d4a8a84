#include "forecast/drift.h"

#include <algorithm>

namespace joulecast::forecast {

std::int64_t DriftWatch::add(double score) {
  const double step = std::clamp(score, -most, most);
  const auto follow = [](double& sum, std::int64_t& since, double by) {
    sum = std::max(0.0, sum + by - slack);
    since = sum > 0 ? since + 1 : 0;
  };
  follow(up_, since_up_, step);
  follow(down_, since_down_, -step);
  if (up_ <= limit && down_ <= limit) return 0;
  const std::int64_t since = up_ > limit ? since_up_ : since_down_;
  *this = {};
  return since;
}

}  // namespace joulecast::forecast
