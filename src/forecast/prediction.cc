#include "forecast/prediction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "planning/root.h"
#include "statistics/distributions.h"

namespace joulecast::forecast {
namespace {

constexpr double farthest = 6;  // scores are clamped here

double normal_probability(double z) {
  return 0.5 * std::erfc(-z / std::numbers::sqrt2);
}

double normal_deviate(double probability) {
  static const double least = normal_probability(-farthest);
  return statistics::normal_quantile(std::clamp(probability, least, 1 - least));
}

}  // namespace

// Wilson and Hilferty 1931: the cube root of a gamma variable is nearly normal.
HaltDistribution::HaltDistribution(double mean, double variance, double probability_of_none)
    : mean_(mean), variance_(variance), none_(probability_of_none) {
  if (!(mean > 0)) return;
  static const std::array<double, count> deviate = [] {
    std::array<double, count> z{};
    for (std::size_t k = 0; k < count; ++k)
      z[k] = normal_deviate((static_cast<double>(k) + 0.5) / static_cast<double>(count));
    return z;
  }();
  const double some = std::max(1e-9, 1 - none_), middle = mean / some;
  const double spread = std::max(0.0, (variance + mean * mean) / some - middle * middle) / (middle * middle);
  for (std::size_t k = 0; k < count; ++k) {
    const double root = std::max(0.0, 1 - spread / 9 + deviate[k] * std::sqrt(spread) / 3);
    values_[k] = middle * root * root * root;
  }
}

double Prediction::below(double amount) const {
  const auto share = [&](double halted) {
    const double left = amount - fixed - halted;
    if (!(legs > 0)) return left >= 0 ? 1.0 : 0.0;
    return left > 0 ? normal_probability(std::log(left / legs) / spread) : 0.0;
  };
  if (halts.none()) return share(0);
  double sum = 0;
  for (const double halted : halts.values()) sum += share(halted);
  return halts.probability_of_none() * share(0) + halts.weight() * sum;
}

double Prediction::score_of(double amount) const {
  if (halts.none() && legs > 0) {
    const double left = std::max(amount - fixed, 1e-9 * legs);
    return std::log(left / legs) / spread;
  }
  return normal_deviate(below(amount));
}

double Prediction::at_score(double z) const {
  const double least = fixed + legs * std::exp(spread * z);
  if (halts.none()) return least;
  z = std::clamp(z, -farthest, farthest);
  const double wanted = normal_probability(z);
  const auto off = [&](double amount) { return below(amount) - wanted; };
  // A halt less long than the longest is likelier than not to suffice.
  const double at_low = off(least), longest = least + halts.values().back(), at_longest = off(longest);
  if (at_low >= 0) return least;
  if (at_longest <= 0) return longest;
  constexpr double close = 1e-5;
  return planning::zero_between(off, least, at_low, longest, at_longest, close);
}

double Prediction::quantile(double probability) const {
  return at_score(inflation * scores->quantile(probability));
}

double Prediction::probability_below(double amount, double deviation) const {
  const auto budget_covers = [&](double spent) {
    if (!(deviation > 0)) return spent <= amount ? 1.0 : 0.0;
    return normal_probability((amount - spent) / deviation);
  };
  if (!(legs > 0) && halts.none()) return budget_covers(fixed);
  constexpr double narrow = 0.5;  // deviation of the budget over that of the energy
  if (legs > 0 && deviation <= narrow * inflation * std::hypot(spread * legs, std::sqrt(halts.variance()))) {
    // It widens the legs' part as independent parts do, and leaves its shape.
    Prediction wider = *this;
    wider.spread = std::hypot(spread, deviation / (inflation * legs));
    return scores->probability(wider.score_of(amount) / inflation);
  }
  // Atoms four at a time: the budget's deviation is wider than their distance.
  constexpr std::size_t together = 4;
  const auto atoms = scores->atoms();
  double sum = 0;
  for (std::size_t k = 0; k < atoms.size(); k += together) {
    const double spent = fixed + legs * std::exp(inflation * spread * 0.5 * (atoms[k + 1] + atoms[k + 2]));
    if (halts.none()) {
      sum += budget_covers(spent);
      continue;
    }
    sum += halts.probability_of_none() * budget_covers(spent);
    for (const double halted : halts.values()) sum += halts.weight() * budget_covers(spent + halted);
  }
  return sum * together / static_cast<double>(atoms.size());
}

}  // namespace joulecast::forecast
