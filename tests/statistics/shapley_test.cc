#include "statistics/shapley.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

namespace joulecast::statistics {
namespace {

using Members = std::vector<std::size_t>;

bool has(const Members& members, std::size_t player) {
  return std::ranges::find(members, player) != members.end();
}

TEST(Shapley, AdditiveGameHasOwnShares) {
  const std::vector<double> worth{1, 4, 0.5, 2};
  const auto shares = shapley_shares(4, [&](const Members& members) {
    double gap = 10;
    for (const std::size_t k : members) gap -= worth[k];
    return gap;
  });
  for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(shares[k], worth[k] / 10, 1e-14) << k;
}

TEST(Shapley, SolvesTheGloveGame) {
  // One left glove, two right ones: a pair is worth 1. Shapley 1953: 2/3, 1/6, 1/6.
  const auto shares = shapley_shares(3, [](const Members& members) {
    return has(members, 0) && (has(members, 1) || has(members, 2)) ? 2.0 : 3.0;
  });
  EXPECT_NEAR(shares[0], 2.0 / 3 / 3, 1e-14);
  EXPECT_NEAR(shares[1], 1.0 / 6 / 3, 1e-14);
  EXPECT_NEAR(shares[2], 1.0 / 6 / 3, 1e-14);
}

TEST(Shapley, SharesSumToTheTotal) {
  // Any game: the gap of a set is the square of the remainder of 7.
  const auto gap = [](const Members& members) {
    double left = 7;
    for (const std::size_t k : members) left -= 0.5 + static_cast<double>(k * k) / 4;
    return left * left;
  };
  Members all(5);
  std::iota(all.begin(), all.end(), 0u);
  const auto shares = shapley_shares(5, gap);
  EXPECT_NEAR(std::accumulate(shares.begin(), shares.end(), 0.0), 1 - gap(all) / gap({}), 1e-12);
}

TEST(Shapley, EvaluatesEverySubsetOnce) {
  std::vector<Members> asked;
  shapley_shares(3, [&](const Members& members) {
    EXPECT_TRUE(std::ranges::is_sorted(members));
    asked.push_back(members);
    return 1.0;
  });
  std::ranges::sort(asked);
  EXPECT_EQ(asked, (std::vector<Members>{{}, {0}, {0, 1}, {0, 1, 2}, {0, 2}, {1}, {1, 2}, {2}}));
}

TEST(Shapley, HandlesNoPlayers) {
  EXPECT_TRUE(shapley_shares(0, [](const Members&) { return 1.0; }).empty());
  const auto shares =
      shapley_shares(2, [](const Members& members) { return static_cast<double>(members.size()); });
  EXPECT_EQ(shares, (std::vector<double>{0, 0}));
}

}  // namespace
}  // namespace joulecast::statistics
