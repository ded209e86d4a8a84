#include "statistics/selection.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace joulecast::statistics {
namespace {

// Scores of the first model are 0; the others differ from it by `ahead` a block, in turn more and less by
// `scatter`.
Eigen::MatrixXd scores(Eigen::Index blocks, const std::vector<double>& ahead,
                       const std::vector<double>& scatter) {
  Eigen::MatrixXd score = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(ahead.size()) + 1, blocks);
  for (Eigen::Index m = 1; m < score.rows(); ++m) {
    const auto at = static_cast<std::size_t>(m - 1);
    for (Eigen::Index b = 0; b < blocks; ++b) score(m, b) = ahead[at] + (b % 2 == 0 ? 1 : -1) * scatter[at];
  }
  return score;
}

// Of 10 paired differences d +- s the sum is 10 d, and its standard error sqrt(10 * 10 s^2/9) = 10 for s = 3.
TEST(Selection, TakesSmallestWithinOneError) {
  const std::vector<std::size_t> size{0, 1};
  const Selection within = select_within_error(scores(10, {0.99}, {3}), size);
  EXPECT_EQ(within.best, 1u);
  EXPECT_EQ(within.chosen, 0u);
  const Selection beyond = select_within_error(scores(10, {1.01}, {3}), size);
  EXPECT_EQ(beyond.best, 1u);
  EXPECT_EQ(beyond.chosen, 1u);
}

TEST(Selection, TakesBetterOfEqualSizes) {
  // Sizes 2, 1, 1, 3: the largest is best, both of size one are within an error of it.
  const auto score = scores(10, {4.6, 4.8, 5.0}, {3, 3, 0});
  const Selection s = select_within_error(score, std::vector<std::size_t>{2, 1, 1, 3});
  EXPECT_EQ(s.best, 3u);
  EXPECT_EQ(s.chosen, 2u);
}

TEST(Selection, PairsErrorsByBlock) {
  // Blocks differ much, but the larger model is ahead in every one of them by the same.
  Eigen::MatrixXd score(2, 8);
  for (Eigen::Index b = 0; b < 8; ++b)
    score.col(b) << -100.0 * static_cast<double>(b), -100.0 * static_cast<double>(b) + 0.1;
  const Selection s = select_within_error(score, std::vector<std::size_t>{0, 1});
  EXPECT_EQ(s.chosen, 1u);
  EXPECT_NEAR(s.probability[1], 1, 1e-12);
}

TEST(Selection, ProbabilitiesAreChoiceFrequencies) {
  const Selection close = select_within_error(scores(10, {0.99}, {3}), std::vector<std::size_t>{0, 1});
  EXPECT_NEAR(std::accumulate(close.probability.begin(), close.probability.end(), 0.0), 1, 1e-9);
  // At the edge of one error: about every second draw.
  EXPECT_NEAR(close.probability[0], 0.5, 0.15);
  const Selection worse = select_within_error(scores(10, {-1}, {0.1}), std::vector<std::size_t>{0, 1});
  EXPECT_EQ(worse.best, 0u);
  EXPECT_NEAR(worse.probability[0], 1, 1e-9);
}

TEST(Selection, OneBlockTakesTheBest) {
  const Selection s = select_within_error(scores(1, {0.01}, {0}), std::vector<std::size_t>{0, 1});
  EXPECT_EQ(s.chosen, 1u);
  EXPECT_EQ(s.probability[1], 1);
}

}  // namespace
}  // namespace joulecast::statistics
