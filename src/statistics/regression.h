#pragma once

#include <Eigen/Dense>
#include <vector>

namespace joulecast::statistics {

// Huber's weights with which normal errors lose 5 % of efficiency (Huber and Ronchetti, Robust Statistics,
// 2009, section 7.8): 1 within 1.345 spreads, falling beyond.
Eigen::VectorXd huber_weights(const Eigen::VectorXd& residual, double spread);

// Coefficients that minimise b'X'X b - 2 b'X'y, those marked at least zero (Lawson and Hanson, Solving Least
// Squares Problems, 1974, chapter 23).
Eigen::VectorXd signed_solution(const Eigen::MatrixXd& xx, const Eigen::VectorXd& xy,
                                const std::vector<bool>& nonnegative);

// Sums of rows by block, a row each, in the order of the blocks.
Eigen::MatrixXd block_sums(const Eigen::MatrixXd& rows, const std::vector<std::size_t>& block);

// A linear regression that is robust to single rows.
struct Regression {
  Eigen::VectorXd coefficients;
  Eigen::VectorXd weight;  // of each row, at the solution
  Eigen::VectorXd
      sd;  // from blocks of rows, as rows near each other are not independent; of one block, from its rows
  double spread = 0;  // robust, of the residuals
};

// Huber's estimator by iteratively reweighted least squares, scale by spread_about_zero (Huber and Ronchetti,
// Robust Statistics, 2009, chapter 7). `x`: rows by terms; `block` of each row, in any order; terms that are
// zero or of one form with others get the least coefficients that do as well. Terms marked in `nonnegative`
// (empty: none) have coefficients of at least zero; `sd` is that without signs. Rows must be finite.
Regression robust_regression(const Eigen::MatrixXd& x, const Eigen::VectorXd& y,
                             const std::vector<std::size_t>& block,
                             const std::vector<bool>& nonnegative = {});

}  // namespace joulecast::statistics
