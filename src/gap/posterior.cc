#include "gap/posterior.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace joulecast::gap {
namespace {

// An effect or an outside family that moves less than this share of the mean power is no finding.
constexpr double least_effect_share = 0.011;

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

constexpr double leading = 14;  // explanations this far below the best in log odds are let go

// Whether an outside family bends an effect along the variable that the effect itself follows: a departure of
// its shape (a square zone for a round one), not something else.
bool bends(const Hypothesis& family, const Hypothesis& effect) {
  struct Bend {
    std::string_view effect, channel, variable;
  };
  constexpr auto bends =
      std::to_array<Bend>({{"floor_resistance_zone", "wheel_torque", "position"},
                           {"slope", "wheel_torque", "heading"},
                           {"slope", "wheel_torque", "position"},
                           {"stribeck_friction", "wheel_torque", "speed"},
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
                           {"stribeck_friction", "battery_power_from_motion", "speed"},
                           {"no_regeneration", "battery_power_from_motion", "acceleration"}});
  return std::ranges::any_of(bends, [&](const Bend& b) {
    return b.effect == effect.id() && b.channel == family.channel && b.variable == family.variable;
  });
}

// Friction that grows towards standstill is Stribeck's whatever curve it follows: where the flexible speed
// law of a channel says hardly more than his, his stands for it.
void name_low_speed_friction(const Fit& fit, std::vector<std::size_t>& set) {
  constexpr double nearly_all = 0.85;  // of the log odds that the flexible law brings
  const auto& all = fit.columns->hypotheses();
  const auto stribeck = [&](std::size_t h) {
    return !all[h].outside() && all[h].id() == "stribeck_friction";
  };
  const auto law = std::ranges::find_if(set, [&](std::size_t h) {
    return all[h].outside() && all[h].variable == "speed" &&
           (all[h].channel == "wheel_torque" || all[h].channel == "battery_power_from_motion");
  });
  if (law == set.end() || std::ranges::any_of(set, stribeck)) return;
  std::vector<std::size_t> others = set;
  std::erase(others, *law);
  const double without = fit.evidence->log_odds(others), with = fit.evidence->log_odds(set);
  std::optional<std::size_t> best;
  double odds = without + nearly_all * (with - without);
  for (std::size_t h = 0; h < all.size(); ++h) {
    if (!stribeck(h)) continue;
    std::vector<std::size_t> named = others;
    named.push_back(h);
    if (const double o = fit.evidence->log_odds(named); o > odds) {
      odds = o;
      best = h;
    }
  }
  if (!best) return;
  *law = *best;
  std::ranges::sort(set);
}

}  // namespace

double least_outside_of(double gap_share) {
  constexpr double of_power = 0.012, of_gap = 0.2;
  return std::max(of_power, of_gap * gap_share);
}

Posterior posterior_of(const Fit& fit, const MovedShares& moved, double gap_share) {
  const double least_outside = least_outside_of(gap_share);
  Posterior posterior;
  double total = 0;
  std::size_t looked_at = 0;
  for (const Explanation& e : fit.explanations) {
    if (e.log_odds < fit.explanations.front().log_odds - leading || ++looked_at > 60) break;
    const double weight = std::exp(e.log_odds - fit.explanations.front().log_odds);
    // Families that bend an effect are taken out first: what then is left of the effect has to matter.
    std::vector<std::size_t> straight = e.hypotheses;
    name_low_speed_friction(fit, straight);
    Evidence::Estimate estimate = fit.evidence->estimate(straight);
    std::erase_if(straight, [&](std::size_t k) {
      const Hypothesis& h = fit.columns->hypotheses()[k];
      return h.outside() && std::ranges::any_of(e.hypotheses, [&](std::size_t other) {
               const Hypothesis& effect = fit.columns->hypotheses()[other];
               return !effect.outside() && bends(h, effect) &&
                      moved(h, estimate.mean) < moved(effect, estimate.mean);
             });
    });
    if (straight.size() < e.hypotheses.size()) estimate = fit.evidence->estimate(straight);
    std::vector<std::size_t> kept;
    bool outside = false;
    for (const std::size_t k : straight) {
      const Hypothesis& h = fit.columns->hypotheses()[k];
      const double share = moved(h, estimate.mean);
      const bool matters = h.outside()
                               ? share > least_outside
                               : share > least_effect_share ||
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
  for (auto& [set, p] : posterior.sets) p /= total;
  posterior.none /= total;
  posterior.outside /= total;
  return posterior;
}

}  // namespace joulecast::gap
