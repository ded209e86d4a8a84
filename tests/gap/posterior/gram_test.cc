#include "gap/posterior/gram.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/gap/posterior/made_problem.h"

namespace joulecast::gap::posterior {
namespace {

constexpr Eigen::Index rows = 60;
constexpr std::size_t blocks = 3;

// Two effects and one nuisance in one channel; the rows of a block are not adjacent.
struct Made {
  Made() {
    e.effects = 2;
    e.nuisances = 1;
    e.columns = {{0.3, 0.2, 1, 1, true}, {0.5, 0, 1, 0, false}, {0, 0.7, 0, 0, false}};
    ChannelRows channel;
    channel.columns = {0, 1, 2};
    channel.x = made::normal(rows, 3, 1);
    channel.y = made::normal(rows, 1, 2);
    for (Eigen::Index k = 0; k < rows; ++k) {
      channel.block.push_back(ux(k) % blocks);
      channel.resting.push_back(false);
    }
    e.channels.push_back(channel);
    noise.weight = Eigen::VectorXd::Constant(rows, 4).array() + made::normal(rows, 1, 3).array().abs();
    noise.sigma = 0.5;
  }
  Equations e;
  Noise noise;
};

TEST(Grams, SumsOverBlocks) {
  const Made m;
  const Grams grams = make_grams(m.e, std::span(&m.noise, 1), blocks);
  const std::vector<double> once(blocks, 1.0);
  const Information sum = weighted_sum(grams.raw, once);
  const ChannelRows& c = m.e.channels[0];
  EXPECT_TRUE(sum.xx.isApprox(c.x.transpose() * m.noise.weight.asDiagonal() * c.x, 1e-12));
  EXPECT_TRUE(sum.xy.isApprox(c.x.transpose() * m.noise.weight.cwiseProduct(c.y), 1e-12));
}

TEST(Grams, WeightTwoEqualsBlockTwice) {
  const Made m;
  const Grams grams = make_grams(m.e, std::span(&m.noise, 1), blocks);
  const std::vector<double> weights{2, 0, 1};
  const Information sum = weighted_sum(grams.raw, weights);
  EXPECT_TRUE(sum.xx.isApprox(grams.raw[0].xx + grams.raw[0].xx + grams.raw[2].xx, 1e-12));
}

// Ratio of the densities of all rows with and without scatter and tolerances in one covariance matrix.
double brute_force(const Made& m, double factor) {
  const ChannelRows& c = m.e.channels[0];
  Eigen::MatrixXd covariance = m.noise.weight.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd plain = covariance;
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < rows; ++j) {
      for (Eigen::Index k = 0; k < 3; ++k) {
        const Column& column = m.e.columns[ux(k)];
        const double own = column.of_file ? factor : std::min(factor, most_function_factor);
        double variance = std::pow(own * column.tolerance, 2);
        if (c.block[ux(i)] == c.block[ux(j)])
          variance += std::pow(std::min(factor, most_scatter_factor) * column.scatter, 2);
        covariance(i, j) += variance * c.x(i, k) * c.x(j, k);
      }
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> with(covariance), without(plain);
  return -0.5 * c.y.dot(with.solve(c.y)) - with.matrixLLT().diagonal().array().log().sum() +
         without.matrixLLT().diagonal().array().log().sum();
}

TEST(Reduce, MatchesBruteForceCovariance) {
  const Made m;
  const Grams grams = make_grams(m.e, std::span(&m.noise, 1), blocks);
  const ReducedByFactor reduced = reduce(m.e, grams, std::vector<double>(blocks, 1.0));
  for (std::size_t f = 0; f < factor_count; ++f) {
    EXPECT_NEAR(reduced[f].log_evidence - std::log(tolerance_factor_prior[f]),
                brute_force(m, tolerance_factors[f]), 1e-6 * std::fabs(brute_force(m, tolerance_factors[f])))
        << tolerance_factors[f];
  }
}

TEST(LearnNoise, ReturnsSpreadOfWhiteNoise) {
  Made m;
  m.e.channels[0].channel = Channel::power;
  m.e.channels[0].x = made::normal(4000, 3, 4);
  m.e.channels[0].y = 0.25 * made::normal(4000, 1, 5);
  m.e.channels[0].block.clear();
  for (std::size_t k = 0; k < 4000; ++k) m.e.channels[0].block.push_back(k / 200);
  m.e.channels[0].resting.assign(4000, false);
  const Noise noise = learn_noise(m.e.channels[0], m.e, {});
  EXPECT_NEAR(noise.sigma, 0.25, 0.01);
  EXPECT_LT(noise.inflation, 1.6);
}

TEST(LearnNoise, InflatesNoiseSharedByBlocks) {
  Made m;
  m.e.channels[0].channel = Channel::power;
  m.e.channels[0].x = Eigen::MatrixXd::Ones(4000, 3);
  m.e.channels[0].y = made::normal(4000, 1, 6);
  m.e.channels[0].block.clear();
  const Eigen::MatrixXd shared = made::normal(20, 1, 7);
  for (std::size_t k = 0; k < 4000; ++k) {
    m.e.channels[0].block.push_back(k / 200);
    m.e.channels[0].y[ix(k)] += 0.5 * shared(ix(k / 200), 0);
  }
  m.e.channels[0].resting.assign(4000, true);  // one class of size
  // By definition, for residuals about their mean; columns are constant.
  const Eigen::VectorXd e = m.e.channels[0].y.array() - m.e.channels[0].y.mean();
  double clustered = 0;
  for (Eigen::Index b = 0; b < 20; ++b) clustered += std::pow(e.segment(200 * b, 200).sum(), 2);
  const double expected = clustered / e.squaredNorm() * 20 / 19;
  EXPECT_GT(expected, 10);
  EXPECT_NEAR(learn_noise(m.e.channels[0], m.e, {}).inflation, expected, 0.05 * expected);
}

}  // namespace
}  // namespace joulecast::gap::posterior
