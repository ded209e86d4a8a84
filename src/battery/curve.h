#pragma once

#include <utility>
#include <vector>

namespace joulecast::battery {

// A piecewise linear function through points of ascending x.
class Curve {
 public:
  // At least one point, x strictly ascending.
  explicit Curve(std::vector<std::pair<double, double>> points);

  double held(double x) const;      // constant beyond the ends
  double extended(double x) const;  // beyond the ends, along the first and the last piece
  double mean() const;              // over [first x, last x]

  const std::vector<std::pair<double, double>>& points() const { return points_; }

 private:
  std::size_t piece(double x) const;

  std::vector<std::pair<double, double>> points_;
};

}  // namespace joulecast::battery
