#include <gtest/gtest.h>

#include <cmath>

#include "forecast/correction.h"
#include "robots.h"

namespace joulecast::forecast {
namespace {

OwnFinding finding(double friction, double deviation, std::int64_t missions) {
  OwnFinding f;
  f.correction = untried(Subject::stated_energy);
  f.correction.mean[1] = friction;
  f.correction.covariance[1][1] = deviation * deviation;
  f.missions = missions;
  f.scores = {{0.5, 1}};
  return f;
}

TEST(Siblings, WithoutOthersKeepThePrior) {
  const Siblings alone = pool(Subject::stated_energy, {});
  EXPECT_EQ(alone.robots, 0);
  EXPECT_EQ(alone.prior.mean, untried(Subject::stated_energy).mean);
  const OwnFinding newcomer = finding(1.5, 0.1, 1);
  const OwnFinding* const one[] = {&newcomer};
  EXPECT_EQ(pool(Subject::stated_energy, one).robots, 0);
}

TEST(Siblings, SimilarRobotsNarrowThePrior) {
  const std::vector<OwnFinding> found{finding(1.30, 0.02, 20), finding(1.32, 0.02, 20),
                                      finding(1.28, 0.02, 20), finding(1.31, 0.02, 20)};
  std::vector<const OwnFinding*> others;
  for (const OwnFinding& f : found) others.push_back(&f);
  const Siblings pooled = pool(Subject::stated_energy, others);
  EXPECT_EQ(pooled.robots, 4);
  EXPECT_NEAR(pooled.prior.mean[1], 1.30, 0.02);  // shrunk to 1 by the weight of 0.2^2 / 4
  EXPECT_LT(pooled.prior.covariance[1][1], untried(Subject::stated_energy).covariance[1][1]);
  EXPECT_EQ(pooled.scores.size(), 4u);
}

// The mean of robots that agree far from their file is theirs: the prior does not hold it back.
TEST(Siblings, FarKindsKeepTheirMean) {
  const std::vector<OwnFinding> found{finding(1.80, 0.02, 20), finding(1.82, 0.02, 20),
                                      finding(1.78, 0.02, 20), finding(1.80, 0.02, 20)};
  std::vector<const OwnFinding*> others;
  for (const OwnFinding& f : found) others.push_back(&f);
  EXPECT_NEAR(pool(Subject::stated_energy, others).prior.mean[1], 1.80, 0.003);
}

// A robot without missions has the scatter of its kind.
TEST(Siblings, ScatterIsTheKinds) {
  std::vector<OwnFinding> found{finding(1, 0.02, 20), finding(1, 0.02, 20)};
  found[0].scatter = {{0.01, 0.02, 0.03}, 0.006};
  found[1].scatter = {{0.01, 0.04, 0.03}, 0.008};
  const OwnFinding* const others[] = {&found[0], &found[1]};
  const Scatter kind = pool(Subject::stated_energy, others).scatter.value();
  EXPECT_NEAR(kind.legs[0], 0.01, 1e-12);
  EXPECT_NEAR(kind.legs[1], std::sqrt(2 / (std::pow(0.02, -2) + std::pow(0.04, -2))), 1e-12);
  EXPECT_NEAR(kind.common, std::sqrt(2 / (std::pow(0.006, -2) + std::pow(0.008, -2))), 1e-12);
  EXPECT_FALSE(pool(Subject::stated_energy, {}).scatter);
}

TEST(Siblings, UnlikeRobotsContributeLess) {
  const std::vector<OwnFinding> like{finding(1.3, 0.02, 9), finding(1.3, 0.02, 9), finding(1.3, 0.02, 9)};
  const std::vector<OwnFinding> unlike{finding(1.1, 0.02, 9), finding(1.3, 0.02, 9), finding(1.5, 0.02, 9)};
  const auto spread = [](const std::vector<OwnFinding>& found) {
    std::vector<const OwnFinding*> others;
    for (const OwnFinding& f : found) others.push_back(&f);
    return pool(Subject::stated_energy, others).prior.covariance[1][1];
  };
  EXPECT_GT(spread(unlike), 2 * spread(like));
}

}  // namespace
}  // namespace joulecast::forecast
