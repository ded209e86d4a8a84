#pragma once

#include <Eigen/Dense>
#include <array>
#include <vector>

namespace joulecast::statistics {

// What an equation's error shares with those of the two equations before it.
struct Autoregression {
  double one = 0, two = 0;

  // Standard deviation of what is new in an error, over the error's own.
  double innovation() const;
};

// Yule-Walker of order two on residuals, by unbroken runs: continues[k] says that row k follows row k - 1.
// Residuals beyond `bound` spreads are clipped to it. No correlation where fewer than 30 triples follow each
// other.
Autoregression fit_autoregression(const Eigen::VectorXd& residual, const std::vector<bool>& continues,
                                  double spread, double bound);

// rows(k) - one rows(k - 1) - two rows(k - 2) within runs; the first rows of a run are scaled to the same
// variance instead.
void whiten(Eigen::MatrixXd& rows, const std::vector<bool>& continues, const Autoregression& ar);
void whiten(Eigen::VectorXd& rows, const std::vector<bool>& continues, const Autoregression& ar);

}  // namespace joulecast::statistics
