#include "gap/verdict/probability.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/study/trial/rate.h"

namespace joulecast::gap {
namespace {

constexpr std::array standings{Standing::alone, Standing::grouped, Standing::inconclusive, Standing::outside};

TEST(StatedProbability, MatchesTableAtBins) {
  for (const ProbabilityBin& bin : probability_table) {
    EXPECT_DOUBLE_EQ(stated_probability(bin.posterior, bin.standing), bin.probability);
  }
}

TEST(StatedProbability, RisesWithPosterior) {
  for (const Standing standing : standings) {
    double before = 0;
    for (int k = 0; k <= 1000; ++k) {
      const double stated = stated_probability(0.001 * k, standing);
      EXPECT_GE(stated, before) << name_of(standing) << " at " << 0.001 * k;
      before = stated;
    }
    EXPECT_LT(before, 1) << name_of(standing);
  }
}

TEST(ProbabilityTable, IsFittedToTrialResults) {
  int named = 0;
  for (const ProbabilityBin& bin : probability_table) {
    const trial::Rate rate{static_cast<std::size_t>(bin.right), static_cast<std::size_t>(bin.named)};
    const auto [low, high] = rate.interval();
    EXPECT_GE(bin.probability, low);
    EXPECT_LE(bin.probability, high);
    named += bin.named;
  }
  EXPECT_GE(named, 300);
}

}  // namespace
}  // namespace joulecast::gap
