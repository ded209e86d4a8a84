#include "gap/diagnose/held_out.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gap/diagnose/naming.h"
#include "gap/diagnose/referee.h"
#include "gap/diagnose/refit.h"
#include "gap/equations/power.h"
#include "gap/equations/zone_scan.h"
#include "statistics/shapley.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t most_parts = 6;
constexpr std::size_t most_shared = 6;

// Which blocks belong to a part.
std::vector<bool> blocks_of(std::size_t part, std::size_t parts, std::size_t blocks) {
  std::vector<bool> out(blocks);
  for (std::size_t b = 0; b < blocks; ++b) out[b] = b * parts / blocks == part;
  return out;
}

// Material of the other blocks alone.
struct Rest {
  std::vector<Window> windows;
  Material material;
  Rest(const Material& m, const std::vector<bool>& out) : material(m) {
    for (const Window& w : m.windows) {
      if (!out[w.block]) windows.push_back(w);
    }
    material.windows = windows;
  }
};

bool in_zone(const Cause& cause) {
  return !cause.by && cause.effect.effect->info().id == "floor_resistance_zone";
}

// Finds the zone of a floor anew from the blocks that are not left out.
class ZoneScan {
 public:
  ZoneScan(const Material& m, const FitSettings& settings) : windows_(thinned(m.windows)) {
    Material thin = m;
    thin.windows = windows_;
    Shapes scan;
    scan.zones = {everywhere};
    linear_ = linearise(thin, scan, settings.shares, {});
  }

  std::optional<Zone> without(const std::vector<bool>& left_out) const {
    const Noise noise = learn_noise(*linear_.columns, linear_.rows, left_out);
    return find_zone(*linear_.columns, linear_.rows, noise, windows_);
  }

 private:
  std::vector<Window> windows_;
  Linear linear_;
};

// The point of linearisation with another zone in the place of the one that all data show; none: without.
Linear with_zone(const Material& m, const FitResult& fit, const FitSettings& settings,
                 const std::optional<Zone>& zone) {
  Shapes shapes = fit.shapes;
  std::vector<Cause> around = fit.causes;
  if (zone) {
    shapes.zones = {*zone};
    for (Cause& cause : around) {
      if (!in_zone(cause)) continue;
      auto& values = cause.effect.values;
      values[1] = zone->x_m, values[2] = zone->y_m, values[3] = zone->radius_m;
    }
  } else {
    shapes.zones.clear();
    std::erase_if(around, in_zone);
  }
  return linearise(m, shapes, settings.shares, around);
}

}  // namespace

double HeldOut::relative(double BlockErrors::*error) const {
  double sum = 0, size = 0;
  for (const BlockErrors& b : blocks) {
    sum += b.*error;
    size += b.size;
  }
  return size > 0 ? sum / size : std::numeric_limits<double>::quiet_NaN();
}

std::optional<HeldOut> hold_out(const Material& m, const FitResult& fit, std::span<const double> power_w,
                                const FitSettings& settings, const std::function<bool(double)>& goes_on) {
  HeldOut held;
  held.blocks.resize(m.blocks);
  held.parts = std::min(most_parts, m.blocks);
  std::optional<ZoneScan> zones;
  if (!fit.shapes.zones.empty()) zones.emplace(m, settings);
  const std::vector<double> unchanged = modelled_power(m.robot, m.adopted, {}, m.windows);
  for (std::size_t part = 0; part < held.parts; ++part) {
    const std::vector<bool> out = blocks_of(part, held.parts, m.blocks);
    std::optional<Linear> zoned;
    if (zones) zoned = with_zone(m, fit, settings, zones->without(out));
    const Linear& linear = zoned ? *zoned : fit.linear;
    const Noise noise = learn_noise(*linear.columns, linear.rows, out);
    const Problem problem = make_problem(*linear.columns, linear.rows, noise, m.blocks);
    const Explanation explanation = explain(problem, out, settings.explain);
    const Named named = name_causes(m, *linear.columns, problem, explanation, power_w, out);
    std::vector<std::string> ids;
    for (const std::size_t h : named.set) ids.push_back(problem.hypotheses[h].id());
    held.named.push_back(std::move(ids));
    const std::vector<double> explained = modelled_power(m.robot, m.adopted, named.causes, m.windows);
    std::vector<double> based;
    if (!fit.base.empty()) {
      const std::vector<Cause> all = refit(Rest(m, out).material, joined(fit.base, named.causes));
      based = modelled_power(m.robot, m.adopted, all, m.windows);
    }
    std::vector<bool> others(m.windows.size());
    for (std::size_t k = 0; k < m.windows.size(); ++k) others[k] = !out[m.windows[k].block];
    const Referee referee(m, power_w, others);
    for (std::size_t k = 0; k < m.windows.size(); ++k) {
      if (others[k] || !std::isfinite(power_w[k] + unchanged[k])) continue;
      BlockErrors& b = held.blocks[m.windows[k].block];
      b.unchanged += std::fabs(power_w[k] - unchanged[k]);
      b.explained += std::fabs(power_w[k] - explained[k]);
      if (!based.empty()) b.based += std::fabs(power_w[k] - based[k]);
      b.referee += std::fabs(power_w[k] - referee.predict(m.windows[k]));
      b.size += std::fabs(power_w[k]);
    }
    if (!goes_on(static_cast<double>(part + 1) / static_cast<double>(held.parts))) return std::nullopt;
  }
  return held;
}

std::vector<double> held_out_shares(const Material& m, const FitResult& fit, const Problem& problem,
                                    const HypothesisSet& named, std::span<const double> power_w) {
  struct Part {
    std::vector<Window> windows;
    std::vector<double> measured;
    std::vector<Cause> named, others;
  };
  const std::size_t parts = std::min(most_parts, m.blocks);
  std::vector<Part> all(parts);
  for (std::size_t part = 0; part < parts; ++part) {
    const std::vector<bool> out = blocks_of(part, parts, m.blocks);
    Part& p = all[part];
    p.named = strengths_of(*fit.linear.columns, problem, named, out);
    if (!fit.base.empty()) {
      for (const Cause& cause : refit(Rest(m, out).material, joined(fit.base, p.named))) {
        const auto own = std::ranges::find_if(p.named, [&](const Cause& n) { return n.same_kind(cause); });
        own == p.named.end() ? p.others.push_back(cause) : void(*own = cause);
      }
    }
    for (std::size_t k = 0; k < m.windows.size(); ++k) {
      if (!out[m.windows[k].block] || !std::isfinite(power_w[k])) continue;
      p.windows.push_back(m.windows[k]);
      p.measured.push_back(power_w[k]);
    }
  }
  std::vector<double> shares = statistics::shapley_shares(
      std::min(named.size(), most_shared), [&](const std::vector<std::size_t>& members) {
        double missed = 0;
        for (const Part& part : all) {
          std::vector<Cause> some = part.others;
          for (const std::size_t k : members) some.push_back(part.named[k]);
          const std::vector<double> modelled = modelled_power(m.robot, m.adopted, some, part.windows);
          for (std::size_t k = 0; k < modelled.size(); ++k)
            missed += std::fabs(part.measured[k] - modelled[k]);
        }
        return missed;
      });
  shares.resize(named.size(), 0);
  return shares;
}

}  // namespace joulecast::gap
