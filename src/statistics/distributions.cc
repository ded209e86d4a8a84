#include "statistics/distributions.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <numbers>

namespace joulecast::statistics {

double normal_cdf(double z) {
  return 0.5 * std::erfc(-z / std::numbers::sqrt2);
}

double log_normal_cdf(double z) {
  if (z > -20) return std::log(normal_cdf(z));
  // Abramowitz and Stegun 26.2.12: the tail itself underflows.
  return -0.5 * z * z - std::log(-z * std::sqrt(2 * std::numbers::pi)) + std::log1p(-1 / (z * z));
}

double log_normal_within(double mean, double sd, double least, double most) {
  if (std::isinf(most)) return std::isinf(least) ? 0.0 : log_normal_cdf((mean - least) / sd);
  if (std::isinf(least)) return log_normal_cdf((most - mean) / sd);
  // On the side where the mean lies outside, differences of the tail that is not cut off keep their digits.
  const double low = (least - mean) / sd, high = (most - mean) / sd;
  const double above = log_normal_cdf(low > 0 ? -low : high), below = log_normal_cdf(low > 0 ? -high : low);
  return above + std::log1p(-std::min(std::exp(below - above), 1 - 1e-12));
}

double normal_quantile(double probability) {
  return boost::math::quantile(boost::math::normal_distribution<double>(), probability);
}

double student_t_quantile(double probability, double freedom) {
  return boost::math::quantile(boost::math::students_t_distribution<double>(freedom), probability);
}

double chi_squared_tail(double x, double freedom) {
  if (!(x > 0)) return 1;
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared_distribution<double>(freedom), x));
}

std::array<double, 2> wilson_interval(std::size_t hits, std::size_t tries) {
  if (tries == 0) return {0, 1};
  const double n = static_cast<double>(tries), p = static_cast<double>(hits) / n;
  const double z = 1.959963984540054, spread = z * z / n;
  const double centre = (p + 0.5 * spread) / (1 + spread);
  const double half = std::sqrt(spread * p * (1 - p) + 0.25 * spread * spread) / (1 + spread);
  return {std::max(0.0, centre - half), std::min(1.0, centre + half)};
}

}  // namespace joulecast::statistics
