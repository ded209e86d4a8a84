#include <gtest/gtest.h>

#include "gap/posterior/catalogue.h"

namespace joulecast::gap {
namespace {

std::vector<Window> windows_with(std::initializer_list<double> values) {
  std::vector<Window> windows(values.size());
  std::size_t k = 0;
  for (const double value : values) windows[k++].covariates = {value};
  return windows;
}

// A load proportional to the covariate then needs no additional constant load.
TEST(Modulation, CentresAmountsAtZero) {
  for (const auto& windows : {windows_with({0, 20, 80, 100}), windows_with({0.2, 0.5, 0.9, missing})}) {
    const auto modulations = modulations_of(windows);
    ASSERT_EQ(modulations.size(), 1u);
    EXPECT_EQ(modulations[0].centre, 0);
    EXPECT_DOUBLE_EQ(modulations[0].of(windows[1]), windows[1].covariates[0]);
  }
}

TEST(Modulation, CentresOtherScalesAtMedian) {
  for (const auto& windows : {windows_with({18, 20, 22, 25, 30}), windows_with({-10, -5, 22, 25, 30})}) {
    const auto modulations = modulations_of(windows);
    ASSERT_EQ(modulations.size(), 1u);
    EXPECT_EQ(modulations[0].centre, 22);
  }
}

TEST(Modulation, RequiresVaryingCovariate) {
  EXPECT_TRUE(modulations_of(windows_with({3, 3, 3})).empty());
  EXPECT_TRUE(modulations_of(windows_with({1, missing, missing})).empty());
}

}  // namespace
}  // namespace joulecast::gap
