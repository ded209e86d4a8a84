#include "forecast/correction.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace joulecast::forecast {
namespace {

constexpr Eigen::Index n = static_cast<Eigen::Index>(feature_count);
using Column = Eigen::Matrix<double, n, 1>;
using Square = Eigen::Matrix<double, n, n, Eigen::RowMajor>;
using ColumnMap = Eigen::Map<Column>;
using SquareMap = Eigen::Map<Square>;

constexpr double middle_speed = 0.6;
constexpr double huber = 3;  // deviations beyond which a leg counts less

Eigen::Map<const Column> column(const Features& x) {
  return Eigen::Map<const Column>(x.data());
}
Eigen::Map<const Square> square(const std::array<Features, feature_count>& m) {
  return Eigen::Map<const Square>(m.front().data());
}

Features moving_features(Motion motion, double payload_fraction, double amount, const LegCost& cost,
                         const Correction& now) {
  Features x{};
  if (motion == Motion::stand) return x;
  const std::size_t moving = motion == Motion::turn ? 2 : 1;
  x[moving] = amount;
  x[payload_feature] = amount * payload_fraction * now.mean[moving];
  if (motion == Motion::drive) x[4] = amount * (cost.speed_fraction - middle_speed);
  return x;
}

constexpr double between = 0.13;      // standard deviation between robots that is assumed, of the prior's
constexpr double between_weight = 3;  // robots that the assumption counts for
constexpr std::int64_t least_missions = 3;
constexpr std::size_t scores_each = 40;

}  // namespace

Features features_of(Motion motion, double payload_fraction, const LegCost& cost, const Correction& now) {
  Features x = moving_features(motion, payload_fraction, cost.motor_j, cost, now);
  x[0] = cost.standing_j;
  return x;
}

Features duration_features_of(Motion motion, double payload_fraction, const LegCost& cost,
                              const Correction& now) {
  Features x = moving_features(motion, payload_fraction, cost.duration_s, cost, now);
  x[0] = cost.runs_on;
  return x;
}

double Correction::energy_j(const Features& x) const {
  return column(mean).dot(column(x));
}

double Correction::variance_j2(const Features& x) const {
  return column(x).dot(square(covariance) * column(x));
}

Correction untried(Subject subject) {
  Correction prior;
  constexpr Features energies{0.155, 0.35, 1.1, 0.2, 0.19}, durations{0.1, 0.055, 0.045, 0.01, 0.04};
  const Features& deviation = is_duration(subject) ? durations : energies;
  if (is_duration(subject)) prior.mean[0] = 0;
  for (std::size_t k = 0; k < feature_count; ++k) prior.covariance[k][k] = deviation[k] * deviation[k];
  const auto correlate = [&](std::size_t a, std::size_t b, double by) {
    prior.covariance[a][b] = prior.covariance[b][a] = by * deviation[a] * deviation[b];
  };
  if (!is_duration(subject))
    correlate(1, 2, 0.8), correlate(1, payload_feature, 0.65), correlate(2, payload_feature, 0.7);
  return prior;
}

double prior_share(double off, double variance, double prior_variance) {
  constexpr double freedom = 5;
  return (freedom + 1) / (freedom + (off * off + variance) / prior_variance);
}

void CorrectionFit::forget(double keep) {
  SquareMap(information_.front().data()) *= keep;
  ColumnMap(weighted_.data()) *= keep;
}

void CorrectionFit::remove(const CorrectionFit& other, double share) {
  SquareMap(information_.front().data()) -= share * square(other.information_);
  ColumnMap(weighted_.data()) -= share * column(other.weighted_);
}

void CorrectionFit::add(std::span<const Evidence> mission, double common, const Correction& now) {
  Square information = Square::Zero();
  Column weighted = Column::Zero(), across = Column::Zero();
  double shared = 0, across_y = 0;
  for (const Evidence& leg : mission) {
    const auto x = column(leg.features);
    const double expected = now.energy_j(leg.features);
    const double off = std::fabs(leg.battery_j - expected) /
                       std::hypot(leg.deviation_j, std::sqrt(now.variance_j2(leg.features)));
    const double w = (off > huber ? huber / off : 1) / (leg.deviation_j * leg.deviation_j);
    information.noalias() += w * x * x.transpose();
    weighted.noalias() += w * leg.battery_j * x;
    across.noalias() += w * expected * x;
    shared += w * expected * expected;
    across_y += w * expected * leg.battery_j;
  }
  // Sherman and Morrison, for the covariance D + common^2 y y^T of the mission's legs.
  const double share = common * common / (1 + common * common * shared);
  SquareMap(information_.front().data()) += information - share * across * across.transpose();
  ColumnMap(weighted_.data()) += weighted - share * across_y * across;
}

Correction CorrectionFit::posterior(const Correction& prior) const {
  const Square before = square(prior.covariance).inverse();
  Correction after;
  Column share = Column::Ones();  // of the prior's precision
  for (int round = 0; round < prior_rounds; ++round) {
    const Square held = share.cwiseSqrt().asDiagonal() * before * share.cwiseSqrt().asDiagonal();
    const Eigen::LDLT<Square> solved(held + square(information_));
    ColumnMap(after.mean.data()) = solved.solve(held * column(prior.mean) + column(weighted_));
    SquareMap(after.covariance.front().data()) = solved.solve(Square::Identity());
    for (std::size_t k = 0; k < feature_count; ++k)
      share[static_cast<Eigen::Index>(k)] =
          prior_share(after.mean[k] - prior.mean[k], after.covariance[k][k], prior.covariance[k][k]);
  }
  return after;
}

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
