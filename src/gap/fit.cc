#include "gap/fit.h"

#include <algorithm>
#include <cmath>

#include "gap/zone_scan.h"

namespace joulecast::gap {
namespace {

constexpr int most_rounds = 4;
// Log odds of an explanation from which on the formulas' own errors count as much as the noise.
constexpr double trusted_log_odds = 300;
constexpr double settled = 0.01;  // relative change of every coefficient

Fit make_fit(const robot::RobotModel& robot, std::span<const Window> windows, bool power,
             const Shapes& shapes, double gap_share, std::span<const dynamics::ActiveEffect> around,
             const MethodParts& parts) {
  Fit fit;
  fit.columns = std::make_unique<ColumnSet>(robot, windows, power, shapes, gap_share);
  fit.columns->leave_out(parts);
  std::vector<Chosen> chosen;
  for (const dynamics::ActiveEffect& effect : around) {
    if (auto c = fit.columns->coordinates_of(effect)) chosen.push_back(std::move(*c));
  }
  if (!chosen.empty()) fit.columns->linearise_around(chosen);
  fit.design = make_design(*fit.columns, windows, parts.whitening);
  fit.missions = mission_information(*fit.columns, fit.design);
  for (const Information& mission : fit.missions) fit.total += mission;
  fit.evidence = std::make_unique<Evidence>(*fit.columns, fit.total);
  fit.explanations = search(*fit.evidence);
  const double signal = fit.explanations.front().log_odds;
  fit.evidence = std::make_unique<Evidence>(*fit.columns, fit.total, coarsening_for(signal));
  fit.explanations = search(*fit.evidence);
  return fit;
}

}  // namespace

bool without_motor_channels(std::span<const Window> windows) {
  const auto with = std::ranges::count_if(windows, [](const Window& w) {
    return std::isfinite(w.current_a[0]) && std::isfinite(w.current_a[1]);
  });
  return static_cast<std::size_t>(with) < windows.size() / 5;
}

double coarsening_for(double log_odds) {
  return 1 / (1 + std::max(0.0, log_odds) / trusted_log_odds);
}

MovedShares::MovedShares(const Fit& fit, std::span<const Window> windows)
    : columns_(*fit.columns),
      values_(columns_.hypotheses().size()),
      samples_(columns_.hypotheses().size(), 0) {
  const std::size_t p = columns_.size(), stride = std::max<std::size_t>(1, windows.size() / 300);
  std::vector<double> rows(p * channel_count);
  ChannelValues<double> values;
  std::vector<std::vector<double>> kept(values_.size());
  for (std::size_t k = 0; k < windows.size(); k += stride) {
    columns_.evaluate(windows[k], values, rows);
    for (std::size_t h = 0; h < values_.size(); ++h) {
      const Hypothesis& hypothesis = columns_.hypotheses()[h];
      if (!hypothesis.outside()) continue;
      // Of a pair of channels the right-hand one stands for both.
      for (std::size_t c = 0; c < channel_count; ++c) {
        const double* row = rows.data() + c * p + hypothesis.columns.front();
        if (std::all_of(row, row + hypothesis.columns.size(), [](double v) { return v == 0; })) continue;
        kept[h].insert(kept[h].end(), row, row + hypothesis.columns.size());
        break;
      }
      ++samples_[h];
    }
  }
  for (std::size_t h = 0; h < values_.size(); ++h) {
    const auto n = static_cast<Eigen::Index>(columns_.hypotheses()[h].columns.size());
    if (kept[h].empty()) continue;
    values_[h] = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
        kept[h].data(), static_cast<Eigen::Index>(kept[h].size()) / n, n);
  }
}

double MovedShares::operator()(const Hypothesis& hypothesis, const Eigen::VectorXd& coefficients) const {
  const auto& columns = columns_.columns();
  if (!hypothesis.outside()) {
    double square = 0;
    for (const std::size_t j : hypothesis.columns) {
      square += std::pow(coefficients[static_cast<Eigen::Index>(j)] * columns[j].power_w, 2);
    }
    return std::sqrt(square) / columns_.mean_power_w();
  }
  const auto h = static_cast<std::size_t>(&hypothesis - columns_.hypotheses().data());
  if (values_[h].size() == 0) return 0;
  const auto own = coefficients.segment(static_cast<Eigen::Index>(hypothesis.columns.front()),
                                        static_cast<Eigen::Index>(hypothesis.columns.size()));
  const double unit = columns[hypothesis.columns.front()].power_w / columns_.mean_power_w();
  return (values_[h] * own).cwiseAbs().sum() / static_cast<double>(samples_[h]) * unit;
}

std::optional<FitResult> fit_windows(const robot::RobotModel& robot, std::span<const Window> windows,
                                     double gap_share, const std::function<bool(double)>& goes_on,
                                     const MethodParts& parts) {
  const auto cancelled = [&](double part) { return goes_on && !goes_on(part); };
  const bool power = without_motor_channels(windows);
  FitResult result;
  if (ranges_of(windows, robot).position) {
    Shapes scan;
    scan.zones = {everywhere};
    ColumnSet columns(robot, windows, power, scan, gap_share);
    columns.leave_out(parts);
    const auto zone = std::ranges::find_if(
        columns.hypotheses(), [](const Hypothesis& h) { return h.id() == "floor_resistance_zone"; });
    const Design design = make_design(columns, windows, parts.whitening);
    if (cancelled(0.2)) return std::nullopt;
    const auto found =
        find_zone(columns, design, windows, static_cast<std::size_t>(zone - columns.hypotheses().begin()));
    if (found) result.shapes.zones = {*found};
  }
  if (cancelled(0.35)) return std::nullopt;
  std::vector<dynamics::ActiveEffect> around;
  double factor = 1.5;
  for (int round = 0; round < most_rounds; ++round) {
    result.fit = make_fit(robot, windows, power, result.shapes, gap_share, around, parts);
    if (cancelled(0.35 + 0.12 * (round + 1))) return std::nullopt;
    const Fit& fit = result.fit;
    const Explanation& best = fit.explanations.front();
    const Evidence::Estimate estimate = fit.evidence->estimate(best.hypotheses);
    std::vector<Chosen> next;
    for (const std::size_t h : best.hypotheses) {
      const Hypothesis& hypothesis = fit.columns->hypotheses()[h];
      if (hypothesis.outside()) continue;
      Chosen chosen{h, {}};
      for (const std::size_t j : hypothesis.columns)
        chosen.coefficients.push_back(estimate.mean[static_cast<Eigen::Index>(j)]);
      next.push_back(std::move(chosen));
    }
    const std::vector<dynamics::ActiveEffect> effects = fit.columns->effects_of(next);
    bool stands = effects.size() == around.size();
    for (std::size_t k = 0; stands && k < effects.size(); ++k) {
      stands = effects[k].effect == around[k].effect;
      for (std::size_t q = 0; stands && q < effects[k].values.size(); ++q) {
        stands = std::fabs(effects[k].values[q] - around[k].values[q]) <=
                 settled * std::fabs(effects[k].values[q]) + 1e-12;
      }
    }
    result.chosen = std::move(next);
    if (stands) break;
    around = effects;
    for (const dynamics::ActiveEffect& effect : around) {
      result.shapes.narrow(effect, robot.kinematics.wheel_radius_m, factor);
    }
    factor = std::sqrt(factor);
  }
  return result;
}

}  // namespace joulecast::gap
