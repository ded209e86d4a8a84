#include "gap/diagnose/held_out.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gap/diagnose/fewer_causes.h"
#include "gap/diagnose/naming.h"
#include "gap/diagnose/power_fit.h"
#include "gap/diagnose/referee.h"
#include "gap/diagnose/refit.h"
#include "gap/equations/power.h"
#include "gap/equations/zone_scan.h"
#include "statistics/distributions.h"
#include "statistics/shapley.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t max_folds = 6;
constexpr std::size_t max_shared_causes = 6;

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

// Where the blocks show no zone none can be there.
void forbid_zones(Problem& problem) {
  for (Hypothesis& h : problem.hypotheses) {
    if (h.id() == zone_effect) h.candidate.log_prior = -std::numeric_limits<double>::infinity();
  }
}

// The point of linearisation with another zone in the place of the one that all data show. Where nothing is
// found in a zone only its columns differ.
Linear with_zone(const Material& m, const FitResult& fit, const FitSettings& settings, const Zone& zone) {
  Shapes shapes = fit.shapes;
  shapes.zones = {zone};
  std::vector<Cause> around = fit.causes;
  for (Cause& cause : around) {
    if (!is_zone(cause)) continue;
    auto& values = cause.effect.values;
    values[1] = zone.x_m, values[2] = zone.y_m, values[3] = zone.radius_m;
  }
  if (std::ranges::any_of(around, is_zone)) return linearise(m, shapes, settings.shares, around);
  Linear linear = linearise(m, shapes, settings.shares, around, std::array{zone_effect}, fit.linear.noise);
  HypothesisSet own;
  for (std::size_t h = 0; h < linear.columns->hypotheses().size(); ++h) {
    if (linear.columns->hypotheses()[h].id() == zone_effect) own.push_back(h);
  }
  const std::vector<std::size_t> columns = columns_of(linear.columns->hypotheses(), own);
  for (std::size_t c = 0; c < channel_count; ++c) {
    ChannelRows rows = fit.linear.rows[c];
    const std::vector<Eigen::Index> to = places_of(rows, columns), from = places_of(linear.rows[c], columns);
    for (std::size_t k = 0; k < columns.size(); ++k) {
      if (to[k] < 0) continue;
      if (from[k] < 0) {
        rows.x.col(to[k]).setZero();
      } else {
        rows.x.col(to[k]) = linear.rows[c].x.col(from[k]);
      }
    }
    linear.rows[c] = std::move(rows);
  }
  return linear;
}

// What is found without some blocks.
struct Found {
  Named named;
  std::vector<std::string> ids;
  std::vector<double> left_w;  // left_with_functions()
};

Found find_without(const std::vector<bool>& out, const Material& m, const FitResult& fit,
                   std::span<const double> power_w, const FitSettings& settings) {
  std::optional<Zone> zone;
  std::optional<Linear> zoned;
  if (!fit.shapes.zones.empty()) zone = fit.zones->without(out);
  if (zone) zoned = with_zone(m, fit, settings, *zone);
  const Linear& linear = zoned ? *zoned : fit.linear;
  const Noise noise = learn_noise(*linear.columns, linear.rows, out);
  Problem problem = make_problem(*linear.columns, linear.rows, noise, m.blocks);
  if (!zone) forbid_zones(problem);
  const Mixture mixture(problem, out);
  Explanation explanation = explain(mixture, out, settings.explain);
  const Equations equations{*linear.columns, linear.rows, noise, out};
  prefer_fewer_causes(equations, mixture, explanation);
  Found found;
  found.named = name_causes(m, equations, problem, explanation, power_w);
  for (const std::size_t h : found.named.set) found.ids.push_back(problem.hypotheses[h].id());
  if (fit.base.empty())
    found.left_w = left_with_functions(equations, problem, explanation, found.named.set, m.windows.size());
  return found;
}

}  // namespace

double HeldOut::relative(const std::function<double(const BlockErrors&)>& error) const {
  double sum = 0, size = 0;
  for (const BlockErrors& b : blocks) {
    sum += error(b);
    size += b.size;
  }
  return size > 0 ? sum / size : std::numeric_limits<double>::quiet_NaN();
}

double HeldOut::found_again(const std::set<std::string>& ids) const {
  const auto one_of = [&](const std::string& id) { return ids.contains(id); };
  const auto times =
      std::ranges::count_if(named, [&](const auto& part) { return std::ranges::any_of(part, one_of); });
  return static_cast<double>(times) / static_cast<double>(parts);
}

std::optional<HeldOut> hold_out(const Material& m, const FitResult& fit, std::span<const double> power_w,
                                const FitSettings& settings, const std::function<bool(double)>& goes_on) {
  const Material whole = based(m, fit);
  HeldOut held;
  held.blocks.resize(m.blocks);
  held.parts = std::min(max_folds, m.blocks);
  const std::vector<double> unchanged = modelled_power(m.robot, m.adopted, {}, m.windows);
  for (std::size_t part = 0; part < held.parts; ++part) {
    const std::vector<bool> out = blocks_of(part, held.parts, m.blocks);
    const Found found = fit.alone ? Found{} : find_without(out, whole, fit, power_w, settings);
    const std::vector<double>& left = found.left_w;
    held.named.push_back(found.ids);
    // What is named may be something else than what everything is linear around.
    held.causes.push_back(fit.base.empty() && !m.from_motion.alone()
                              ? found.named.causes
                              : refit(Rest(m, out).material, joined(fit.base, found.named.causes)));
    const std::vector<double> explained = modelled_power(m.robot, m.adopted, held.causes.back(), m.windows);
    std::vector<bool> others(m.windows.size());
    for (std::size_t k = 0; k < m.windows.size(); ++k) others[k] = !out[m.windows[k].block];
    const Referee referee(m, power_w, others);
    for (std::size_t k = 0; k < m.windows.size(); ++k) {
      if (others[k] || !std::isfinite(power_w[k] + unchanged[k])) continue;
      BlockErrors& b = held.blocks[m.windows[k].block];
      b.unchanged += std::fabs(power_w[k] - unchanged[k]);
      b.unchanged_energy += power_w[k] - unchanged[k];
      b.explained_energy += power_w[k] - explained[k];
      const double missed = std::fabs(power_w[k] - explained[k]);
      b.explained += missed;
      if (!left.empty() && std::isfinite(left[k])) b.spared += missed - std::fabs(left[k]);
      b.referee += std::fabs(power_w[k] - referee.predict(m.windows[k]));
      b.size += std::fabs(power_w[k]);
    }
    if (!goes_on(static_cast<double>(part + 1) / static_cast<double>(held.parts))) return std::nullopt;
  }
  return held;
}

std::vector<Need> base_needed(const Material& m, const FitResult& fit, const HeldOut& held,
                              std::span<const double> power_w) {
  std::vector<std::vector<double>> more(fit.base.size(), std::vector<double>(m.blocks));
  for (std::size_t part = 0; part < held.parts; ++part) {
    const std::vector<bool> out = blocks_of(part, held.parts, m.blocks);
    const Rest rest(m, out);
    const std::vector<Cause>& causes = held.causes[part];
    const std::vector<double> with = modelled_power(m.robot, m.adopted, causes, m.windows);
    for (std::size_t b = 0; b < fit.base.size(); ++b) {
      std::vector<Cause> others = causes;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(b));
      const std::vector<double> without =
          modelled_power(m.robot, m.adopted, refit(rest.material, std::move(others)), m.windows);
      for (std::size_t k = 0; k < m.windows.size(); ++k) {
        if (!out[m.windows[k].block] || !std::isfinite(power_w[k])) continue;
        more[b][m.windows[k].block] += std::fabs(power_w[k] - without[k]) - std::fabs(power_w[k] - with[k]);
      }
    }
  }
  std::vector<Need> needs;
  double size = 0;
  for (const BlockErrors& b : held.blocks) size += b.size;
  for (const std::vector<double>& blocks : more) {
    double sum = 0, squares = 0;
    for (const double d : blocks) sum += d, squares += d * d;
    needs.push_back(
        {squares > 0 ? std::exp(statistics::log_normal_cdf(sum / std::sqrt(squares))) : 0.5, sum / size});
  }
  return needs;
}

std::vector<double> held_out_shares(const Material& m, const FitResult& fit, const Problem& problem,
                                    const HypothesisSet& named, std::span<const double> power_w) {
  struct Part {
    std::vector<Window> windows;
    std::vector<double> measured;
    std::vector<Cause> named, others;
  };
  const std::size_t parts = std::min(max_folds, m.blocks);
  std::vector<Part> all(parts);
  for (std::size_t part = 0; part < parts; ++part) {
    const std::vector<bool> out = blocks_of(part, parts, m.blocks);
    Part& p = all[part];
    p.named = strengths_of({*fit.linear.columns, fit.linear.rows, fit.linear.noise, out}, problem, named);
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
  const std::size_t sharing = std::min(named.size(), max_shared_causes);
  std::vector<double> shares =
      statistics::shapley_shares(sharing, [&](const std::vector<std::size_t>& members) {
        double missed = 0;
        for (const Part& part : all) {
          std::vector<Cause> some = part.others;
          some.insert(some.end(), part.named.begin() + static_cast<std::ptrdiff_t>(sharing),
                      part.named.end());
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
