#include "gap/power_gap.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/median.h"
#include "gap/shapley.h"

namespace joulecast::gap {

std::vector<double> measured_power(std::span<const Window> windows) {
  std::vector<double> power(windows.size());
  std::ranges::transform(windows, power.begin(), &Window::battery_power_w);
  return power;
}

dynamics::DriveModel extended_model(const robot::RobotModel& robot,
                                    std::span<const dynamics::ActiveEffect> effects) {
  auto all = dynamics::active_effects(robot).value_or(std::vector<dynamics::ActiveEffect>{});
  all.insert(all.end(), effects.begin(), effects.end());
  return {robot, all};
}

std::vector<double> modelled_power(const robot::RobotModel& robot,
                                   std::span<const dynamics::ActiveEffect> effects,
                                   std::span<const Window> windows) {
  const dynamics::DriveModel model = extended_model(robot, effects);
  std::vector<double> power(windows.size());
  std::ranges::transform(windows, power.begin(), [&](const Window& w) { return metered_power(model, w); });
  return power;
}

GapSize gap_size(std::span<const double> measured_w, std::span<const double> modelled_w) {
  double difference = 0, absolute = 0, total = 0, size = 0;
  for (std::size_t k = 0; k < measured_w.size(); ++k) {
    const double e = measured_w[k] - modelled_w[k];
    if (!std::isfinite(e)) continue;
    difference += e;
    absolute += std::fabs(e);
    total += measured_w[k];
    size += std::fabs(measured_w[k]);
  }
  GapSize gap;
  gap.energy_relative = total != 0 ? difference / total : 0;
  gap.absolute_relative = size > 0 ? absolute / size : 0;
  return gap;
}

double noise_floor(std::span<const Window> windows, std::span<const double> measured_w,
                   std::span<const double> modelled_w) {
  // Every second window, so that none share samples.
  std::vector<double> second;
  double size = 0;
  std::size_t count = 0;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    if (!std::isfinite(measured_w[k])) continue;
    size += std::fabs(measured_w[k]);
    ++count;
    if (k < 4 || !(windows[k].continues && windows[k - 1].continues && windows[k - 2].continues &&
                   windows[k - 3].continues)) {
      continue;
    }
    const auto e = [&](std::size_t n) { return measured_w[n] - modelled_w[n]; };
    const double d = e(k) - 2 * e(k - 2) + e(k - 4);
    if (std::isfinite(d)) second.push_back(std::fabs(d));
  }
  if (second.empty() || size <= 0) return 0;
  const double sigma = 1.4826 * upper_median(std::move(second)) / std::sqrt(6.0);
  return sigma * std::sqrt(2 / std::numbers::pi) * static_cast<double>(count) / size;
}

std::vector<double> effect_shares(const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> effects,
                                  std::span<const Window> windows, std::span<const double> measured_w) {
  constexpr std::size_t most = 6;
  std::vector<double> shares = shapley_shares(std::min(effects.size(), most), [&](const auto& members) {
    std::vector<dynamics::ActiveEffect> some;
    for (const std::size_t k : members) some.push_back(effects[k]);
    return gap_size(measured_w, modelled_power(robot, some, windows)).absolute_relative;
  });
  shares.resize(effects.size(), 0.0);
  return shares;
}

}  // namespace joulecast::gap
