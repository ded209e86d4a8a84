#include "gap/posterior/functions.h"

#include <gtest/gtest.h>

namespace joulecast::gap::posterior {
namespace {

TEST(Hats, SumsToOne) {
  const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(50, -3, 9);
  const Eigen::MatrixXd z = hats(x, {0, 1, 4, 6});
  EXPECT_TRUE(z.rowwise().sum().isOnes(1e-12));
  EXPECT_GE(z.minCoeff(), 0);
}

TEST(Hats, EqualsOneAtKnot) {
  const Eigen::MatrixXd z = hats(Eigen::Vector3d(0, 1, 4), {0, 1, 4});
  EXPECT_TRUE(z.isIdentity(1e-12));
}

TEST(Hats, InterpolatesBetweenKnots) {
  const Eigen::MatrixXd z = hats(Eigen::VectorXd::Constant(1, 2.5), {0, 1, 4});
  EXPECT_DOUBLE_EQ(z(0, 1), 0.5);
  EXPECT_DOUBLE_EQ(z(0, 2), 0.5);
}

}  // namespace
}  // namespace joulecast::gap::posterior
