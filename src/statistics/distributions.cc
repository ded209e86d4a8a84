#include "statistics/distributions.h"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <numbers>

namespace joulecast::statistics {

double log_normal_cdf(double z) {
  if (z > 0) return std::log1p(-0.5 * std::erfc(z / std::numbers::sqrt2));
  if (z > -30) return std::log(0.5 * std::erfc(-z / std::numbers::sqrt2));
  // Abramowitz and Stegun 26.2.12: the tail itself underflows.
  const double q = 1 / (z * z);
  return -0.5 * z * z - std::log(-z * std::sqrt(2 * std::numbers::pi)) +
         std::log1p(-q * (1 - 3 * q * (1 - 5 * q)));
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

}  // namespace joulecast::statistics
