#include "forecast/scores.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "planning/numerics.h"
#include "statistics/distributions.h"

namespace joulecast::forecast {
namespace {

// Student's t of 5 degrees of freedom at 1/2 + (k + 1/2)/40, scaled to unit variance by sqrt(3/5).
constexpr double unit_variance = 0.7745966692414834;
constexpr std::array<double, 20> upper_half_t5{0.0329, 0.0990, 0.1655, 0.2330, 0.3017, 0.3722, 0.4449,
                                               0.5204, 0.5994, 0.6829, 0.7720, 0.8682, 0.9735, 1.0911,
                                               1.2254, 1.3838, 1.5798, 1.8409, 2.2423, 3.1634};

std::vector<Scores::Entry> reference(double deviation) {
  std::vector<Scores::Entry> entries;
  for (const double t : upper_half_t5) {
    for (const double sign : {-1.0, 1.0})
      entries.push_back({sign * t * unit_variance * deviation,
                         reference_weight / (2 * static_cast<double>(upper_half_t5.size()))});
  }
  return entries;
}

std::array<double, ScoreDistribution::count> quantiles_of(std::vector<Scores::Entry> entries,
                                                          double weight_to_come) {
  std::ranges::sort(entries, {}, &Scores::Entry::score);
  const double total = std::accumulate(entries.begin(), entries.end(), 0.0,
                                       [](double sum, const Scores::Entry& e) { return sum + e.weight; });
  std::array<double, ScoreDistribution::count> atoms{};
  // Each entry sits at the middle of its weight, half of that of the score to come lies beyond either end: n
  // equal entries stand at k/(n + 1). Straight lines in between, the outermost hold beyond.
  std::size_t k = 0;
  double below = 0.5 * weight_to_come;
  for (std::size_t a = 0; a < atoms.size(); ++a) {
    const double wanted = (static_cast<double>(a) + 0.5) / static_cast<double>(ScoreDistribution::count) *
                          (total + weight_to_come);
    while (k + 1 < entries.size() && below + entries[k].weight + 0.5 * entries[k + 1].weight < wanted)
      below += entries[k++].weight;
    const double here = below + 0.5 * entries[k].weight;
    if (wanted <= here || k + 1 == entries.size()) {
      atoms[a] = entries[k].score;
      continue;
    }
    const double next = below + entries[k].weight + 0.5 * entries[k + 1].weight;
    atoms[a] = std::lerp(entries[k].score, entries[k + 1].score, (wanted - here) / (next - here));
  }
  return atoms;
}

constexpr double farthest = 6;  // scores are clamped here

double normal_probability(double z) {
  return 0.5 * std::erfc(-z / std::numbers::sqrt2);
}

double normal_deviate(double probability) {
  static const double least = normal_probability(-farthest);
  return statistics::normal_quantile(std::clamp(probability, least, 1 - least));
}

}  // namespace

ScoreDistribution::ScoreDistribution() : atoms_(quantiles_of(reference(1), 0)) {}

double ScoreDistribution::quantile(double probability) const {
  const double at = std::clamp(probability, 0.0, 1.0) * static_cast<double>(count) - 0.5;
  if (at <= 0) return atoms_.front();
  const auto k = static_cast<std::size_t>(at);
  if (k + 1 >= count) return atoms_.back();
  return std::lerp(atoms_[k], atoms_[k + 1], at - static_cast<double>(k));
}

double ScoreDistribution::probability(double z) const {
  constexpr double beyond = 0.5 / static_cast<double>(count), fade = 0.5;
  if (z <= atoms_.front()) return beyond * std::exp((z - atoms_.front()) / fade);
  if (z >= atoms_.back()) return 1 - beyond * std::exp((atoms_.back() - z) / fade);
  const auto above = static_cast<std::size_t>(std::ranges::upper_bound(atoms_, z) - atoms_.begin());
  const double low = atoms_[above - 1], high = atoms_[above];
  const double at = static_cast<double>(above - 1) + (z - low) / (high - low);
  return (at + 0.5) / static_cast<double>(count);
}

void Scores::add(double score, double weight) {
  discount(keep);
  if (entries_.size() == most) entries_.erase(entries_.begin());
  entries_.push_back({score, weight});
}

void Scores::discount(double share) {
  for (Entry& entry : entries_) entry.weight *= share;
}

double Scores::weight() const {
  return std::accumulate(entries_.begin(), entries_.end(), 0.0,
                         [](double sum, const Entry& e) { return sum + e.weight; });
}

ScoreDistribution pooled_scores(const Scores& own, std::span<const Scores::Entry> siblings) {
  std::vector<Scores::Entry> entries = own.entries();
  double offered = 0;
  for (const Scores::Entry& entry : siblings) offered += entry.weight;
  const double wanted = std::min(offered, own_enough - own.weight());
  if (wanted > 0) {
    for (const Scores::Entry& entry : siblings)
      entries.push_back({entry.score, entry.weight * wanted / offered});
  }
  // The reference needs no room for the score to come: it is a distribution, and no sample of one.
  const double seen = own.weight() + std::max(0.0, wanted);
  double squares = reference_weight;
  for (const Scores::Entry& entry : entries) squares += entry.weight * entry.score * entry.score;
  const std::vector<Scores::Entry> shape = reference(std::sqrt(squares / (reference_weight + seen)));
  entries.insert(entries.end(), shape.begin(), shape.end());
  return ScoreDistribution(quantiles_of(std::move(entries), seen / (seen + reference_weight)));
}

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
