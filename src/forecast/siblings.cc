#include "forecast/siblings.h"

#include <algorithm>
#include <cmath>

namespace joulecast::forecast {
namespace {

constexpr double between = 0.13;      // standard deviation between robots that is assumed, of the prior's
constexpr double between_weight = 3;  // robots that the assumption counts for
constexpr std::int64_t least_missions = 3;
constexpr std::size_t scores_each = 40;

}  // namespace

Siblings pool(Subject subject, std::span<const OwnFinding* const> others) {
  const Correction start = untried(subject);
  Siblings siblings{start, {}, 0, {}, {}};
  std::vector<const OwnFinding*> known;
  for (const OwnFinding* finding : others)
    if (finding->missions >= least_missions) known.push_back(finding);
  siblings.robots = static_cast<std::int64_t>(known.size());
  if (known.empty()) return siblings;
  std::vector<const Habit*> habits;
  for (const OwnFinding* finding : known) habits.push_back(&finding->habit);
  siblings.habit = habit_of_kind(habits);
  const auto scale = [&](const auto& deviation) {
    double precision = 0;
    for (const OwnFinding* finding : known) precision += std::pow(deviation(finding->scatter), -2);
    return std::sqrt(static_cast<double>(known.size()) / precision);
  };
  Scatter& scatter = siblings.scatter.emplace();
  for (std::size_t k = 0; k < motion_count; ++k)
    scatter.legs[k] = scale([k](const Scatter& s) { return s.legs[k]; });
  scatter.common = scale([](const Scatter& s) { return s.common; });
  for (std::size_t k = 0; k < feature_count; ++k) {
    const double assumed = between * between * start.covariance[k][k];
    double spread = assumed, mean = start.mean[k], variance = start.covariance[k][k];
    for (int round = 0; round < prior_rounds; ++round) {
      const double off = mean - start.mean[k], prior_variance = start.covariance[k][k];
      double weight = prior_share(off, variance, prior_variance) / prior_variance;
      double sum = weight * start.mean[k];
      for (const OwnFinding* finding : known) {
        const double w = 1 / (finding->correction.covariance[k][k] + spread);
        weight += w;
        sum += w * finding->correction.mean[k];
      }
      mean = sum / weight;
      variance = 1 / weight;
      double beyond = between_weight * assumed;
      for (const OwnFinding* finding : known) {
        const double apart = finding->correction.mean[k] - mean;
        beyond += std::max(0.0, apart * apart - finding->correction.covariance[k][k]);
      }
      spread = beyond / (between_weight + static_cast<double>(known.size()));
    }
    siblings.prior.mean[k] = mean;
    const double share = std::min(1.0, (variance + spread) / start.covariance[k][k]);
    for (std::size_t j = 0; j < feature_count; ++j)  // correlations remain
      siblings.prior.covariance[k][j] = siblings.prior.covariance[j][k] *= j == k ? share : std::sqrt(share);
  }
  for (const OwnFinding* finding : known) {
    const std::size_t from = finding->scores.size() - std::min(finding->scores.size(), scores_each);
    siblings.scores.insert(siblings.scores.end(), finding->scores.begin() + static_cast<std::ptrdiff_t>(from),
                           finding->scores.end());
  }
  return siblings;
}

}  // namespace joulecast::forecast
