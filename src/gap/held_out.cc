#include "gap/held_out.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "gap/power_gap.h"

namespace joulecast::gap {
namespace {

constexpr double bootstrap_block_s = 10;
constexpr int bootstrap_draws = 400;

}  // namespace

std::vector<Chosen> coefficients_of(const Fit& fit, const Information& total,
                                    std::span<const std::size_t> set) {
  const Evidence evidence(*fit.columns, total);
  const Evidence::Estimate estimate = evidence.estimate(set);
  std::vector<Chosen> chosen;
  for (const std::size_t h : set) {
    if (fit.columns->hypotheses()[h].outside()) continue;
    Chosen c{h, {}};
    for (const std::size_t j : fit.columns->hypotheses()[h].columns) {
      c.coefficients.push_back(estimate.mean[static_cast<Eigen::Index>(j)]);
    }
    chosen.push_back(std::move(c));
  }
  return chosen;
}

Shrinkage held_out(const Fit& fit, const robot::RobotModel& robot, std::span<const std::size_t> set,
                   std::span<const Window> windows, std::span<const double> measured,
                   std::span<const double> plain, std::span<const double> nominal, double floor) {
  std::vector<double> predicted(windows.size(), missing);
  for (std::size_t m = 0; m < fit.missions.size(); ++m) {
    Information rest;
    for (std::size_t k = 0; k < fit.missions.size(); ++k) {
      if (k != m) rest += fit.missions[k];
    }
    if (rest.xx.size() == 0) rest = fit.total;
    const auto effects = fit.columns->effects_of(coefficients_of(fit, rest, set));
    const dynamics::DriveModel model = extended_model(robot, effects);
    for (std::size_t k = 0; k < windows.size(); ++k) {
      if (windows[k].mission == m) predicted[k] = metered_power(model, windows[k]);
    }
  }
  struct Block {
    double before = 0, after = 0, size = 0;
  };
  std::map<std::pair<std::size_t, int>, Block> by_time;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    if (!std::isfinite(measured[k] + predicted[k])) continue;
    Block& b = by_time[{windows[k].mission, static_cast<int>(windows[k].t_s / bootstrap_block_s)}];
    b.before += std::fabs(plain[k] - nominal[k]);
    b.after += std::fabs(measured[k] - predicted[k]);
    b.size += std::fabs(measured[k]);
  }
  std::vector<Block> blocks;
  Block sum;
  for (const auto& [key, b] : by_time) {
    blocks.push_back(b);
    sum.before += b.before;
    sum.after += b.after;
    sum.size += b.size;
  }
  Shrinkage s;
  if (blocks.empty() || sum.size <= 0 || sum.before <= 0) return s;
  s.before = sum.before / sum.size;
  s.after = sum.after / sum.size;
  s.fraction = 1 - sum.after / sum.before;
  s.remaining_over_noise_floor = floor > 0 ? s.after / floor : missing;
  std::mt19937_64 random(20240229);
  std::uniform_int_distribution<std::size_t> pick(0, blocks.size() - 1);
  std::vector<double> fractions;
  for (int draw = 0; draw < bootstrap_draws; ++draw) {
    Block d;
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      const Block& b = blocks[pick(random)];
      d.before += b.before;
      d.after += b.after;
    }
    fractions.push_back(1 - d.after / d.before);
  }
  std::ranges::sort(fractions);
  s.interval = {fractions[bootstrap_draws / 40], fractions[bootstrap_draws - 1 - bootstrap_draws / 40]};
  return s;
}

}  // namespace joulecast::gap
