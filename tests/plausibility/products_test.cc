#include "plausibility/products.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace joulecast::plausibility {
namespace {

// y = 2 a - 3 b + noise, in `blocks` blocks of 10 rows; in each `spoilt`-th block y has an offset.
Products relation(std::mt19937_64& random, int blocks, double noise, int spoilt = 0) {
  std::normal_distribution<double> normal;
  Products products;
  for (int block = 0; block < blocks; ++block) {
    for (int row = 0; row < 10; ++row) {
      const double a = normal(random), b = normal(random);
      const double off = spoilt > 0 && block % spoilt == 0 ? 40 * a : 0.0;
      products.add({2 * a - 3 * b + noise * normal(random) + off, a, b, 0.0});
    }
    products.next_block();
  }
  products.finish();
  return products;
}

const std::vector<Eigen::Index> both{1, 2};

TEST(Products, MatchesStatedIntervalCoverage) {
  std::mt19937_64 random(7);
  int covered = 0;
  for (int k = 0; k < 400; ++k) {
    const Products products = relation(random, 30, 1.0);
    const auto interval = estimate(fit_blocks(products.blocks(), 0, both), 0).interval();
    covered += interval[0] < 2 && 2 < interval[1];
  }
  // 95 % of 400 are 380, with a standard deviation of 4.4.
  EXPECT_GT(covered, 360);
  EXPECT_LT(covered, 398);
}

// The wheels turn alike in all blocks but one. The heading drifts with distance and jumps in that block. Two
// coefficients fit all blocks, and only that block separates them.
TEST(Products, RejectsCertaintyFromOneBlock) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  int sure = 0;
  constexpr int trials = 300;
  for (int k = 0; k < trials; ++k) {
    Products products;
    for (int block = 0; block < 6; ++block) {
      for (int row = 0; row < 3; ++row) {
        const double way = 5 + normal(random), apart = block == 2 ? 0.05 : 1e-4 * normal(random);
        products.add({0.01 * way + (block == 2 ? 0.5 : 1e-4 * normal(random)), way, way + apart});
      }
      products.next_block();
    }
    products.finish();
    sure += estimate(fit_blocks(products.blocks(), 0, both), 0).sure();
  }
  EXPECT_LE(sure, trials / 50);
}

TEST(Products, LimitsInfluenceOfOutlierBlocks) {
  std::mt19937_64 random(8);
  const Products products = relation(random, 40, 0.1, 8);
  const BlockFit fit = fit_blocks(products.blocks(), 0, both);
  EXPECT_NEAR(fit.coefficient[0], 2, 0.4);
  EXPECT_NEAR(fit.coefficient[1], -3, 0.4);
}

TEST(Products, IgnoresConstantInputs) {
  std::mt19937_64 random(9);
  const Products products = relation(random, 30, 0.1);
  const std::vector<Eigen::Index> all{1, 2, 3};
  const BlockFit fit = fit_blocks(products.blocks(), 0, all);
  EXPECT_NEAR(fit.coefficient[0], 2, 0.1);
  EXPECT_FALSE(estimate(fit, 2).known());
  EXPECT_TRUE(estimate(fit, 0).sure());
}

TEST(Products, RejectsCollinearTerms) {
  Products products;
  for (int k = 0; k < 300; ++k) {
    const double a = std::sin(0.1 * k);
    products.add({2 * a, a, 3 * a});
    if (k % 10 == 9) products.next_block();
  }
  EXPECT_FALSE(fit_blocks(products.blocks(), 0, both).known());
}

TEST(Products, BoundsMemoryAndKeepsSums) {
  Products products;
  for (int k = 0; k < 100'000; ++k) {
    products.add({1.0, 2.0});
    if (k % 7 == 0) products.next_block();
  }
  products.finish();
  EXPECT_LE(products.blocks().size(), 65u);
  double rows = 0, sum = 0;
  for (const auto& block : products.blocks()) rows += block.rows, sum += block.sums(0, 1);
  EXPECT_EQ(rows, 100'000);
  EXPECT_EQ(sum, 200'000);
}

TEST(Products, RemovesNoiseOfQuantities) {
  std::mt19937_64 random(10);
  std::normal_distribution<double> normal;
  Products noisy, corrected;
  for (int k = 0; k < 3000; ++k) {  // y = 2 a - 3 b, where b resembles a, read with noise
    const double a = normal(random), b = a + 0.3 * normal(random), y = 2 * a - 3 * b,
                 read = a + 0.1 * normal(random);
    noisy.add({y, read, b});
    corrected.add({y, read, b}, {{0, 0.1 * normal(random), 0}});
    if (k % 10 == 9) noisy.next_block(), corrected.next_block();
  }
  EXPECT_LT(fit_blocks(noisy.blocks(), 0, both).coefficient[0], 1.9);
  const Estimate a = estimate(fit_blocks(corrected.blocks(), 0, both), 0);
  EXPECT_NEAR(a.value, 2, 0.05);
  EXPECT_LT(std::fabs(a.value - 2), 3 * a.sd);
}

TEST(Products, ReturnsRatioOfMeans) {
  Products products;
  for (int k = 0; k < 200; ++k) {
    const double x = 5 + std::sin(0.3 * k);
    products.add({2 * x, x, 1.0});
    if (k % 10 == 9) products.next_block();
  }
  const Estimate ratio = ratio_of_sums(products.blocks(), 0, 1, 2);
  EXPECT_NEAR(ratio.value, 2, 1e-12);
  EXPECT_NEAR(ratio.sd, 0, 1e-9);
}

}  // namespace
}  // namespace joulecast::plausibility
