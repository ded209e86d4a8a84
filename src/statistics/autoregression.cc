#include "statistics/autoregression.h"

#include <algorithm>
#include <cmath>

namespace joulecast::statistics {
namespace {

constexpr std::size_t fewest_triples = 30;
constexpr double most_two = 0.6, most_sum = 0.95;  // keeps the filter stable and rows from vanishing

// From the last row to the first, so that nothing is read after it was changed.
template <class Rows>
void whiten_any(Rows& rows, const std::vector<bool>& continues, const Autoregression& ar) {
  const double first = ar.innovation();
  for (Eigen::Index k = rows.rows(); k-- > 0;) {
    const auto at = static_cast<std::size_t>(k);
    if (k >= 2 && continues[at] && continues[at - 1]) {
      rows.row(k) -= ar.one * rows.row(k - 1) + ar.two * rows.row(k - 2);
    } else {
      rows.row(k) *= first;
    }
  }
}

}  // namespace

double Autoregression::innovation() const {
  // Variance of the process over that of its innovation, Box and Jenkins (3.2.28).
  const double ratio = (1 - two) / ((1 + two) * ((1 - two) * (1 - two) - one * one));
  return 1 / std::sqrt(std::clamp(ratio, 1.0, 400.0));
}

Autoregression fit_autoregression(const Eigen::VectorXd& residual, const std::vector<bool>& continues,
                                  double spread, double bound) {
  const auto clipped = [&](Eigen::Index k) { return std::clamp(residual[k], -bound * spread, bound * spread); };
  std::array<double, 3> product{};
  std::array<std::size_t, 3> count{};
  for (Eigen::Index k = 0; k < residual.size(); ++k) {
    for (Eigen::Index lag = 0; lag <= 2 && lag <= k; ++lag) {
      if (lag > 0 && !continues[static_cast<std::size_t>(k - lag + 1)]) break;
      product[static_cast<std::size_t>(lag)] += clipped(k) * clipped(k - lag);
      ++count[static_cast<std::size_t>(lag)];
    }
  }
  Autoregression ar;
  if (count[2] < fewest_triples || !(product[0] > 0)) return ar;
  const double r0 = product[0] / static_cast<double>(count[0]);
  const double r1 = std::clamp(product[1] / static_cast<double>(count[1]) / r0, -0.99, 0.99),
               r2 = std::clamp(product[2] / static_cast<double>(count[2]) / r0, -0.99, 0.99);
  ar.one = r1 * (1 - r2) / (1 - r1 * r1);
  ar.two = std::clamp((r2 - r1 * r1) / (1 - r1 * r1), -most_two, most_two);
  ar.one = std::clamp(ar.one, -(most_sum - std::fabs(ar.two)), most_sum - std::fabs(ar.two));
  return ar;
}

void whiten(Eigen::MatrixXd& rows, const std::vector<bool>& continues, const Autoregression& ar) {
  whiten_any(rows, continues, ar);
}

void whiten(Eigen::VectorXd& rows, const std::vector<bool>& continues, const Autoregression& ar) {
  whiten_any(rows, continues, ar);
}

}  // namespace joulecast::statistics
