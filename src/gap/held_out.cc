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
constexpr double least_information =
    0.1;  // of all there is on a coefficient, that the other missions must have

// What is known without a part of the windows, and which windows these are.
struct Fold {
  std::size_t first, last;  // windows [first, last)
  Information others;
};

Information without(std::span<const Information> all, std::size_t left_out) {
  Information sum;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (k != left_out) sum += all[k];
  }
  return sum;
}

// One fold for each mission. Where the others hardly know a coefficient of the set, such as that of a load
// that only one mission carried, its halves take turns.
std::vector<Fold> folds_of(const Fit& fit, std::span<const std::size_t> set,
                           std::span<const Window> windows) {
  const auto known = [&](const Information& some) {
    return some.xx.size() > 0 && std::ranges::all_of(set, [&](std::size_t h) {
             const Hypothesis& hypothesis = fit.columns->hypotheses()[h];
             return hypothesis.outside() || std::ranges::all_of(hypothesis.columns, [&](std::size_t k) {
                      const auto j = static_cast<Eigen::Index>(k);
                      return some.xx(j, j) >= least_information * fit.total.xx(j, j);
                    });
           });
  };
  std::vector<Fold> folds;
  for (std::size_t first = 0; first < windows.size();) {
    const std::size_t mission = windows[first].mission;
    std::size_t last = first;
    while (last < windows.size() && windows[last].mission == mission) ++last;
    if (Information others = without(fit.missions, mission); known(others)) {
      folds.push_back({first, last, std::move(others)});
    } else {
      const std::size_t middle = first + (last - first) / 2;
      Design halves = fit.design;
      for (ChannelDesign& d : halves.channels) {
        for (std::size_t row = 0; row < d.mission.size(); ++row) {
          if (d.mission[row] == mission && d.window[row] >= middle) d.mission[row] = halves.missions;
        }
      }
      ++halves.missions;
      const std::vector<Information> parts = mission_information(*fit.columns, halves);
      folds.push_back({first, middle, without(parts, mission)});
      folds.push_back({middle, last, without(parts, parts.size() - 1)});
    }
    first = last;
  }
  return folds;
}

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
  for (const Fold& fold : folds_of(fit, set, windows)) {
    const auto effects = fit.columns->effects_of(coefficients_of(fit, fold.others, set));
    const dynamics::DriveModel model = extended_model(robot, effects);
    for (std::size_t k = fold.first; k < fold.last; ++k) predicted[k] = metered_power(model, windows[k]);
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
