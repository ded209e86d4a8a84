#include "statistics/information.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

namespace joulecast::statistics {
namespace {

// Any numbers, the same on every machine.
Eigen::MatrixXd numbers(Eigen::Index rows, Eigen::Index columns, double seed) {
  Eigen::MatrixXd m(rows, columns);
  for (Eigen::Index r = 0; r < rows; ++r) {
    for (Eigen::Index c = 0; c < columns; ++c)
      m(r, c) = std::sin(seed + 1.7 * static_cast<double>(r) + 2.9 * static_cast<double>(c * c) +
                         0.3 * static_cast<double>(r * c));
  }
  return m;
}

Information of(const Eigen::MatrixXd& x, const Eigen::VectorXd& y) {
  Information info(x.cols());
  std::vector<Eigen::Index> all(static_cast<std::size_t>(x.cols()));
  std::iota(all.begin(), all.end(), 0);
  info.add(x, y, all);
  return info;
}

void expect_same(const Information& a, const Information& b) {
  EXPECT_NEAR((a.xx - b.xx).norm(), 0, 1e-11);
  EXPECT_NEAR((a.xy - b.xy).norm(), 0, 1e-11);
  EXPECT_NEAR(a.yy, b.yy, 1e-11);
  EXPECT_NEAR(a.log_scale, b.log_scale, 1e-11);
}

TEST(Information, IsProductsOfRows) {
  const Eigen::MatrixXd x = numbers(9, 4, 1);
  const Eigen::VectorXd y = numbers(9, 1, 2);
  const Information info = of(x, y);
  EXPECT_NEAR((info.xx - x.transpose() * x).norm(), 0, 1e-13);
  EXPECT_EQ((info.xx - info.xx.transpose()).norm(), 0);
  EXPECT_NEAR((info.xy - x.transpose() * y).norm(), 0, 1e-13);
  EXPECT_NEAR(info.yy, y.squaredNorm(), 1e-13);
  EXPECT_EQ(info.log_scale, 0);
}

TEST(Information, AcceptsNoRowsOrColumns) {
  Information no_columns(0), no_rows(2);
  no_columns.add(Eigen::MatrixXd(3, 0), Eigen::Vector3d(1, 2, 2), {});
  EXPECT_EQ(no_columns.yy, 9);
  no_rows.add(Eigen::MatrixXd(0, 2), Eigen::VectorXd(0), {0, 1});
  EXPECT_EQ(no_rows.xx.norm() + no_rows.xy.norm() + no_rows.yy, 0);
}

TEST(Information, SparseColumnsEqualZeros) {
  const Eigen::MatrixXd x = numbers(7, 2, 3);
  const Eigen::VectorXd y = numbers(7, 1, 4);
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(7, 5);
  whole.col(3) = x.col(0);
  whole.col(1) = x.col(1);
  Information info(5);
  info.add(x, y, {3, 1});
  expect_same(info, of(whole, y));
}

TEST(Information, AddsUp) {
  const Information a = of(numbers(6, 3, 5), numbers(6, 1, 6)), b = of(numbers(8, 3, 7), numbers(8, 1, 8));
  Eigen::MatrixXd both(14, 3);
  both << numbers(6, 3, 5), numbers(8, 3, 7);
  Eigen::VectorXd y(14);
  y << numbers(6, 1, 6), numbers(8, 1, 8);
  Information sum;
  sum += a;
  sum += b;
  sum += Information();
  expect_same(sum, of(both, y));
  sum += sum;
  sum *= 0.5;
  expect_same(sum, of(both, y));
}

// With y = X b + Z u + e, u ~ N(0, D^2), e ~ N(0, 1), Z the columns that deviate, y has the covariance 1 + Z
// D^2 Z'.
TEST(Information, IntegratesOutADeviation) {
  const Eigen::MatrixXd x = numbers(10, 4, 9);
  const Eigen::VectorXd y = numbers(10, 1, 10), sd = Eigen::Vector4d(0.5, 0, 2, 30);
  Information info = of(x, y);
  info.log_scale = -1.5;
  info.integrate_out(sd);
  const Eigen::MatrixXd covariance =
      Eigen::MatrixXd::Identity(10, 10) + x * sd.cwiseAbs2().asDiagonal() * x.transpose();
  Information marginal(4);
  marginal.xx = x.transpose() * covariance.inverse() * x;
  marginal.xy = x.transpose() * covariance.inverse() * y;
  marginal.yy = y.dot(covariance.inverse() * y);
  marginal.log_scale = -1.5 - 0.5 * std::log(covariance.determinant());
  expect_same(info, marginal);
}

TEST(Information, InvisibleDeviationChangesNothing) {
  Eigen::MatrixXd x = numbers(6, 3, 11);
  x.col(1).setZero();
  Information info = of(x, numbers(6, 1, 12));
  const Information before = info;
  info.integrate_out(Eigen::Vector3d(0, 5, 0));
  expect_same(info, before);
}

}  // namespace
}  // namespace joulecast::statistics
