#include "battery/curve.h"

#include <algorithm>
#include <cassert>

namespace joulecast::battery {

Curve::Curve(std::vector<std::pair<double, double>> points) : points_(std::move(points)) {
  assert(!points_.empty());
}

// The index of the point that starts the piece on which x lies; the end pieces reach to infinity.
std::size_t Curve::piece(double x) const {
  const auto above = std::upper_bound(points_.begin() + 1, points_.end() - 1, x,
                                      [](double value, const auto& point) { return value < point.first; });
  return static_cast<std::size_t>(above - points_.begin()) - 1;
}

double Curve::held(double x) const {
  return extended(std::clamp(x, points_.front().first, points_.back().first));
}

double Curve::extended(double x) const {
  if (points_.size() == 1) return points_.front().second;
  const std::size_t i = piece(x);
  const auto& [x0, y0] = points_[i];
  const auto& [x1, y1] = points_[i + 1];
  return y0 + (y1 - y0) * ((x - x0) / (x1 - x0));
}

double Curve::mean() const {
  if (points_.size() == 1) return points_.front().second;
  double area = 0;
  for (std::size_t i = 1; i < points_.size(); ++i)
    area += (points_[i].first - points_[i - 1].first) * (points_[i].second + points_[i - 1].second) / 2;
  return area / (points_.back().first - points_.front().first);
}

}  // namespace joulecast::battery
