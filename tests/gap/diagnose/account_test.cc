#include "gap/diagnose/account.h"

#include <gtest/gtest.h>

#include <cmath>

namespace joulecast::gap {
namespace {

HeldOut two_blocks() {
  HeldOut held;
  held.parts = 2;
  held.blocks = {{.unchanged = 30, .explained = 10, .referee = 9, .size = 100},
                 {.unchanged = 50, .explained = 14, .referee = 11, .size = 100}};
  return held;
}

TEST(BaselineOf, ErrorsAreSharesOfAllPower) {
  const Baseline b = baseline_of(two_blocks());
  EXPECT_DOUBLE_EQ(b.unchanged_model_held_out, 0.4);
  EXPECT_DOUBLE_EQ(b.explanation_held_out, 0.12);
  EXPECT_DOUBLE_EQ(b.held_out, 0.1);
  // The blocks differ from their better judge by 1 and 3: about their mean by one each.
  EXPECT_DOUBLE_EQ(b.deviation, std::sqrt(2.0) / 200);
  EXPECT_TRUE(b.wins());
}

// Runs and groups are not asked what functions outside the catalogue would spare.
TEST(BaselineOf, FunctionsThatWereNotAskedSpareNothing) {
  HeldOut held = two_blocks();
  EXPECT_DOUBLE_EQ(baseline_of(held, true).explanation_held_out, 0.12);
  held.blocks[1].spared = 6;
  EXPECT_DOUBLE_EQ(baseline_of(held, true).explanation_held_out, 0.09);
  EXPECT_DOUBLE_EQ(baseline_of(held).explanation_held_out, 0.12);
  EXPECT_FALSE(baseline_of(held, true).wins());
}

}  // namespace
}  // namespace joulecast::gap
