#pragma once

#include <Eigen/Dense>
#include <vector>

namespace joulecast::statistics {

// A linear regression that single rows cannot lead astray.
struct Regression {
  Eigen::VectorXd coefficients, sd;  // sd from blocks of rows: rows near each other are not independent
  double spread = 0;                 // robust, of the residuals
};

// Huber's estimator by iteratively reweighted least squares, scale from the residuals' median (Huber and Ronchetti,
// Robust Statistics, 2009, chapter 7). `x`: rows by terms; `block` of each row, ascending; terms that are zero or
// of one form with others get the least coefficients that do as well. Rows must be finite.
Regression robust_regression(const Eigen::MatrixXd& x, const Eigen::VectorXd& y,
                             const std::vector<std::size_t>& block);

}  // namespace joulecast::statistics
