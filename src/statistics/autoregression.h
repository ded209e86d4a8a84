#pragma once

#include <Eigen/Dense>
#include <vector>

namespace joulecast::statistics {

// What an equation's error shares with those of the two equations before it: stationary, |one| < 1 - two and
// two > -1.
struct Autoregression {
  double one = 0, two = 0;
};

// Yule-Walker of order two on residuals, by unbroken runs: continues[k] says that row k follows row k - 1.
// Residuals beyond `bound` spreads are clipped to it. No correlation where fewer than 30 triples follow each
// other.
Autoregression fit_autoregression(const Eigen::VectorXd& residual, const std::vector<bool>& continues,
                                  double spread, double bound);

// rows(k) - one rows(k - 1) - two rows(k - 2) within runs; the first two rows of a run, of which less is
// known, are scaled to the same variance (Box and Jenkins, Time Series Analysis, A7.4).
void whiten(Eigen::MatrixXd& rows, const std::vector<bool>& continues, const Autoregression& ar);
void whiten(Eigen::VectorXd& rows, const std::vector<bool>& continues, const Autoregression& ar);

}  // namespace joulecast::statistics
