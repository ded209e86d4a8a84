#include "forecast/correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "client/virtual_robot/rng.h"

namespace joulecast::forecast {
namespace {

using virtual_robot::Rng;

std::vector<Evidence> draw_mission(Rng& rng, const Features& truth, double scatter, double common) {
  std::vector<Evidence> legs;
  const double level = 1 + common * rng.normal();
  for (int k = 0; k < 12; ++k) {
    Evidence leg;
    leg.features = {rng.uniform(50, 200), 0, 0, 0, 0};
    const int motion = k % 3;
    if (motion == 1) {
      const double motor = rng.uniform(100, 600);
      leg.features[1] = motor;
      leg.features[3] = motor * rng.uniform();
      leg.features[4] = motor * rng.uniform(-0.3, 0.3);
    } else if (motion == 2) {
      leg.features[2] = rng.uniform(30, 100);
    }
    double energy = 0;
    for (std::size_t f = 0; f < feature_count; ++f) energy += truth[f] * leg.features[f];
    leg.deviation_j = scatter * energy;
    leg.battery_j = energy * level * (1 + scatter * rng.normal());
    legs.push_back(leg);
  }
  return legs;
}

TEST(Correction, WithoutEvidenceIsThePrior) {
  const CorrectionFit fit;
  const Correction prior = untried(Subject::stated_energy), after = fit.posterior(prior);
  for (std::size_t k = 0; k < feature_count; ++k) {
    EXPECT_NEAR(after.mean[k], prior.mean[k], 1e-12);
    EXPECT_NEAR(after.covariance[k][k], prior.covariance[k][k], 1e-12);
  }
}

// Truths drawn from the prior and missions drawn as the fit assumes: errors over their own standard
// deviations must then be standard normal. 40 fits of 5 factors; the mean square of n such numbers has
// standard deviation sqrt(2/n) when independent, and factors of one fit are correlated, so that n = 40 bounds
// it.
TEST(Correction, StatedUncertaintyIsCalibrated) {
  Rng rng(7);
  double squares = 0;
  constexpr int fits = 40;
  for (int run = 0; run < fits; ++run) {
    const Correction prior = untried(Subject::stated_energy);
    Features truth = prior.mean;
    for (std::size_t k = 0; k < feature_count; ++k)
      truth[k] += std::sqrt(prior.covariance[k][k]) * rng.normal();
    CorrectionFit fit;
    Correction now = prior;
    for (int m = 0; m < 15; ++m) {
      fit.add(draw_mission(rng, truth, 0.05, 0.03), 0.03, now);
      now = fit.posterior(prior);
    }
    for (std::size_t k = 0; k < feature_count; ++k) {
      const double off = (now.mean[k] - truth[k]) / std::sqrt(now.covariance[k][k]);
      squares += off * off / static_cast<double>(feature_count);
    }
  }
  EXPECT_NEAR(squares / fits, 1, 4 * std::sqrt(2.0 / fits));
}

// One factor of a robot that departs far from its file, against quadrature of a t prior of 5 degrees of
// freedom times the likelihood of the mission's mean.
TEST(Correction, FarEvidenceOverrulesThePrior) {
  constexpr double common = 0.03, expected_j = 100;
  const Correction prior = untried(Subject::stated_energy);
  const double scale = std::sqrt(prior.covariance[1][1]);
  for (const double truth : {1.0, 1.15, 1.5, 1.8}) {
    // The likelihood has this mean and variance: legs of equal weight, and what they share.
    const std::vector<Evidence> legs(16, Evidence{{0, expected_j, 0, 0, 0}, truth * expected_j, 8});
    Correction near = prior;  // no leg is an outlier
    near.mean[1] = truth;
    CorrectionFit fit;
    fit.add(legs, common, near);
    const double variance = 0.08 * 0.08 / 16 + common * common * truth * truth;
    double weight = 0, sum = 0, squares = 0;
    for (double factor = 0; factor < 3; factor += 1e-4) {
      const double d = (factor - 1) / scale, off = factor - truth;
      const double p = std::pow(1 + d * d / 5, -3) * std::exp(-0.5 * off * off / variance);
      weight += p, sum += p * factor, squares += p * factor * factor;
    }
    const double mean = sum / weight, deviation = std::sqrt(squares / weight - mean * mean);
    const Correction after = fit.posterior(prior);
    EXPECT_NEAR(after.mean[1], mean, 0.2 * deviation) << truth;
    EXPECT_NEAR(std::sqrt(after.covariance[1][1]), deviation, 0.2 * deviation) << truth;
    EXPECT_NEAR(after.covariance[0][0], prior.covariance[0][0], 1e-9);  // without evidence
  }
}

// A robot whose file is far from it has no outliers in its first mission: its legs weigh as much as those of
// another.
TEST(Correction, FirstMissionHasNoOutliers) {
  const Correction prior = untried(Subject::stated_energy);
  CorrectionFit near, far;
  near.add(std::vector<Evidence>(10, Evidence{{0, 100, 0, 0, 0}, 100, 8}), 0.03, prior);
  far.add(std::vector<Evidence>(10, Evidence{{0, 100, 0, 0, 0}, 145, 8}), 0.03, prior);
  EXPECT_NEAR(far.posterior(prior).covariance[1][1], near.posterior(prior).covariance[1][1],
              0.3 * near.posterior(prior).covariance[1][1]);
}

// For any number of legs, one mission does not determine the level better than the scatter of missions.
TEST(Correction, OneMissionKeepsCommonScatter) {
  CorrectionFit fit;
  std::vector<Evidence> legs(5000);
  for (Evidence& leg : legs) leg = {{100, 0, 0, 0, 0}, 110, 5};
  constexpr double common = 0.04;
  Correction wide = untried(Subject::stated_energy);
  for (auto& row : wide.covariance) row.fill(0);
  for (std::size_t k = 0; k < feature_count; ++k) wide.covariance[k][k] = 1e4;
  fit.add(legs, common, wide);
  const Correction after = fit.posterior(wide);
  EXPECT_GE(std::sqrt(after.covariance[0][0]), common * 0.999);
}

TEST(Correction, ForgettingWidensTheDeviation) {
  Rng rng(3);
  CorrectionFit fit;
  const Correction prior = untried(Subject::stated_energy);
  for (int m = 0; m < 10; ++m) fit.add(draw_mission(rng, prior.mean, 0.05, 0.02), 0.02, prior);
  const double before = fit.posterior(prior).covariance[1][1];
  fit.forget(0.1);
  EXPECT_GT(fit.posterior(prior).covariance[1][1], before);
}

TEST(Correction, OutlierLegCountsLittle) {
  const Correction prior = untried(Subject::stated_energy);
  std::vector<Evidence> legs(20, Evidence{{0, 500, 0, 0, 0}, 500, 10});
  CorrectionFit clean, pushed;
  clean.add(legs, 0.02, prior);
  legs[0].battery_j = 5000;
  pushed.add(legs, 0.02, prior);
  // Huber's weight bounds the pull of one leg by three of its standard deviations among twenty.
  EXPECT_NEAR(pushed.posterior(prior).mean[1], clean.posterior(prior).mean[1], 3 * 10.0 / 500);
}

}  // namespace
}  // namespace joulecast::forecast
