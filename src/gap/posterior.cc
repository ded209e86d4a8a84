#include "gap/posterior.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace joulecast::gap {
namespace {

// An effect that moves less than this share of the mean power is no finding, unless the data leave no doubt.
double least_share_of(double log_odds) {
  constexpr double usually = 0.011, for_certain = 0.007, certain = 50;
  return log_odds > certain ? for_certain : usually;
}

// How large a coefficient is beside what a robot as filed may have.
bool beyond_tolerance(const ColumnSet& columns, const Evidence::Estimate& estimate, const Hypothesis& h) {
  double size = 0;
  for (const std::size_t j : h.columns) {
    size = std::max(size,
                    std::fabs(estimate.mean[static_cast<Eigen::Index>(j)]) / columns.columns()[j].tolerance);
  }
  return size > 2.5;
}

}  // namespace

bool shows_in_power(std::string_view id) {
  constexpr auto elsewhere = std::to_array<std::string_view>(
      {"wheel_radius_error", "wheel_radius_asymmetry", "track_error", "wheel_slip", "com_offset",
       "battery_resistance", "inductance", "sensor_delay"});
  return std::ranges::find(elsewhere, id) == elsewhere.end();
}

double Posterior::of_effect(const ColumnSet& columns, const dynamics::Effect* effect) const {
  double p = 0;
  for (const auto& [set, probability] : sets) {
    if (std::ranges::any_of(set,
                            [&](std::size_t h) { return columns.hypotheses()[h].effect.effect == effect; }))
      p += probability;
  }
  return p;
}

namespace {

constexpr double against_to_and_fro = 5;  // in log odds
constexpr double leading = 14;            // explanations this far below the best in log odds are let go

// Whether an outside family bends an effect along the variable that the effect itself follows: a departure of
// its shape (a square zone for a round one), not something else. Friction at low speed is called Stribeck's
// although hardly any follows his curve.
bool bends(const Hypothesis& family, double family_share, const Hypothesis& effect, double effect_share) {
  constexpr double shape_of_stribeck = 2.5;
  struct Bend {
    std::string_view effect, channel, variable;
    double most = 1;  // power that the family may move, over the effect's
  };
  constexpr auto bends =
      std::to_array<Bend>({{"floor_resistance_zone", "wheel_torque", "position"},
                           {"slope", "wheel_torque", "heading"},
                           {"slope", "wheel_torque", "position"},
                           {"stribeck_friction", "wheel_torque", "speed", shape_of_stribeck},
                           {"turning_scrub", "wheel_torque", "yaw_rate"},
                           {"gear_efficiency", "wheel_torque", "acceleration"},
                           {"load_rolling_resistance", "wheel_torque", "payload"},
                           {"brush_drop", "motor_voltage", "current"},
                           {"winding_temperature", "motor_voltage", "time"},
                           {"no_regeneration", "battery_power_from_motors", "acceleration"},
                           {"driver_loss", "battery_power_from_motors", "speed"},
                           {"floor_resistance_zone", "battery_power_from_motion", "position"},
                           {"slope", "battery_power_from_motion", "heading"},
                           {"turning_scrub", "battery_power_from_motion", "yaw_rate"},
                           {"stribeck_friction", "battery_power_from_motion", "speed", shape_of_stribeck},
                           {"no_regeneration", "battery_power_from_motion", "acceleration"}});
  return std::ranges::any_of(bends, [&](const Bend& b) {
    return b.effect == effect.id() && b.channel == family.channel && b.variable == family.variable &&
           family_share < b.most * effect_share;
  });
}

// A flexible law bends to noise and to how a formula ends: where one effect of the catalogue says nearly as
// much, it stands for the law. More is forgiven friction that grows towards standstill: it is Stribeck's
// whatever curve it follows.
void name_by_catalogue(const Fit& fit, std::vector<std::size_t>& set) {
  constexpr double nearly_all_of_stribeck = 0.85, nearly_all = 0.92;  // of the log odds that the law brings
  constexpr double close = 4;                                         // in log odds
  const auto& all = fit.columns->hypotheses();
  for (std::size_t& law : set) {
    if (!all[law].outside()) continue;
    const bool of_speed = all[law].variable == "speed" && (all[law].channel == "wheel_torque" ||
                                                           all[law].channel == "battery_power_from_motion");
    std::vector<std::size_t> named = set;
    std::erase(named, law);
    const double without = fit.evidence->log_odds(named), with = fit.evidence->log_odds(set);
    named.push_back(law);
    std::optional<std::size_t> best;
    double most = without;
    for (std::size_t h = 0; h < all.size(); ++h) {
      if (all[h].outside() || std::ranges::any_of(set, [&](std::size_t other) {
            return all[other].effect.effect == all[h].effect.effect;
          }))
        continue;
      named.back() = h;
      const double odds = fit.evidence->log_odds(named);
      const bool enough = of_speed && all[h].id() == "stribeck_friction"
                              ? odds > without + nearly_all_of_stribeck * (with - without)
                              : odds > without + nearly_all * (with - without) && odds > with - close;
      if (!enough || odds <= most) continue;
      most = odds;
      best = h;
    }
    if (best) law = *best;
  }
  std::ranges::sort(set);
}

// Whether the members of an explanation undo most of what each other does.
bool to_and_fro(const Fit& fit, const MovedShares& moved, const Explanation& e,
                const Evidence::Estimate& estimate, double power_gap) {
  constexpr double most = 3;  // power that they move, over the gap
  double sum = 0;
  for (const std::size_t h : e.hypotheses) sum += moved(fit.columns->hypotheses()[h], estimate.mean);
  return sum > most * power_gap;
}

double odds_without(const Fit& fit, std::vector<std::size_t> set, std::size_t member) {
  std::erase(set, member);
  return fit.evidence->log_odds(set);
}

}  // namespace

double least_outside_of(double gap_share, double log_odds) {
  constexpr double of_power = 0.012, without_a_gap = 0.016, for_certain = 0.006, of_gap = 0.2;
  constexpr double closed = 0.01, certain = 30;
  if (gap_share < closed) return without_a_gap;
  const bool sure = log_odds > certain && gap_share > largest_unnamed_share;
  return std::max(sure ? for_certain : of_power, of_gap * gap_share);
}

Posterior posterior_of(const Fit& fit, const MovedShares& moved, double gap_share, double power_gap) {
  Posterior posterior;
  double total = 0;
  std::size_t looked_at = 0;
  for (const Explanation& e : fit.explanations) {
    if (e.log_odds < fit.explanations.front().log_odds - leading || ++looked_at > 60) break;
    Evidence::Estimate estimate = fit.evidence->estimate(e.hypotheses);
    const double held_against = to_and_fro(fit, moved, e, estimate, power_gap) ? against_to_and_fro : 0;
    const double weight = std::exp(e.log_odds - fit.explanations.front().log_odds - held_against);
    // Families that bend an effect are taken out first: what then is left of the effect has to matter.
    std::vector<std::size_t> straight = e.hypotheses;
    name_by_catalogue(fit, straight);
    if (straight != e.hypotheses) estimate = fit.evidence->estimate(straight);
    std::erase_if(straight, [&](std::size_t k) {
      const Hypothesis& h = fit.columns->hypotheses()[k];
      return h.outside() && std::ranges::any_of(e.hypotheses, [&](std::size_t other) {
               const Hypothesis& effect = fit.columns->hypotheses()[other];
               return !effect.outside() &&
                      bends(h, moved(h, estimate.mean), effect, moved(effect, estimate.mean));
             });
    });
    if (straight.size() < e.hypotheses.size()) estimate = fit.evidence->estimate(straight);
    std::vector<std::size_t> kept;
    bool outside = false;
    const double odds = fit.evidence->log_odds(straight);
    for (const std::size_t k : straight) {
      const Hypothesis& h = fit.columns->hypotheses()[k];
      const double share = moved(h, estimate.mean);
      const double gained = odds - odds_without(fit, straight, k);
      const bool matters = h.outside()
                               ? share > least_outside_of(gap_share, gained)
                               : share > least_share_of(gained) ||
                                     (!shows_in_power(h.id()) && beyond_tolerance(*fit.columns, estimate, h));
      if (!matters) continue;
      kept.push_back(k);
      outside = outside || h.outside();
    }
    posterior.sets[kept] += weight;
    total += weight;
    if (kept.empty()) posterior.none += weight;
    if (outside) posterior.outside += weight;
  }
  // A gap that noise does not make is not nothing, however little the channels say what it is.
  if (gap_share > largest_unnamed_share && posterior.sets.size() > 1) {
    posterior.by_gap_alone = posterior.none > 0.5 * total;
    total -= posterior.none;
    posterior.none = 0;
    posterior.sets.erase(std::vector<std::size_t>{});
  }
  for (auto& [set, p] : posterior.sets) p /= total;
  posterior.none /= total;
  posterior.outside /= total;
  return posterior;
}

}  // namespace joulecast::gap
