#include "forecast/siblings.h"

#include <algorithm>

namespace joulecast::forecast {
namespace {

constexpr double between = 0.05;      // standard deviation between robots that is assumed
constexpr double between_weight = 3;  // robots that the assumption counts for
constexpr std::int64_t least_missions = 3;
constexpr std::size_t scores_each = 40;

}  // namespace

Siblings pool(std::span<const OwnFinding* const> others) {
  Siblings siblings;
  std::vector<const OwnFinding*> known;
  for (const OwnFinding* finding : others)
    if (finding->missions >= least_missions) known.push_back(finding);
  siblings.robots = static_cast<std::int64_t>(known.size());
  if (known.empty()) return siblings;
  std::vector<const Habit*> habits;
  for (const OwnFinding* finding : known) habits.push_back(&finding->habit);
  siblings.habit = habit_of_kind(habits);
  const Correction start = untried();
  for (std::size_t k = 0; k < feature_count; ++k) {
    double spread = between * between, mean = start.mean[k], variance = start.covariance[k][k];
    constexpr int rounds = 3;  // mean and spread depend on each other; three rounds settle them
    for (int round = 0; round < rounds; ++round) {
      double weight = 1 / start.covariance[k][k], sum = weight * start.mean[k];
      for (const OwnFinding* finding : known) {
        const double w = 1 / (finding->correction.covariance[k][k] + spread);
        weight += w;
        sum += w * finding->correction.mean[k];
      }
      mean = sum / weight;
      variance = 1 / weight;
      double beyond = between_weight * between * between;
      for (const OwnFinding* finding : known) {
        const double off = finding->correction.mean[k] - mean;
        beyond += std::max(0.0, off * off - finding->correction.covariance[k][k]);
      }
      spread = beyond / (between_weight + static_cast<double>(known.size()));
    }
    siblings.prior.mean[k] = mean;
    siblings.prior.covariance[k][k] = std::min(start.covariance[k][k], variance + spread);
  }
  for (const OwnFinding* finding : known) {
    const std::size_t from = finding->scores.size() - std::min(finding->scores.size(), scores_each);
    siblings.scores.insert(siblings.scores.end(), finding->scores.begin() + static_cast<std::ptrdiff_t>(from),
                           finding->scores.end());
  }
  return siblings;
}

}  // namespace joulecast::forecast
