#include "gap/posterior/catalogue.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "gap/posterior/constants.h"
#include "gap/traits.h"
#include "signals/covariates.h"
#include "statistics/robust.h"

namespace joulecast::gap::posterior {
namespace {

using dynamics::ActiveEffect;

// Shapes that effects are tried with.
constexpr double steepest_rad = 0.3;
constexpr double least_turning = 0.02;  // of the wheels' speeds: less does not count as turning

// Effects that battery power alone does not show, or that must be visible in other channels.
constexpr std::array<std::string_view, 8> need_channels{
    "track_error", "wheel_radius_asymmetry", "com_offset",  "wheel_slip", "winding_temperature",
    "inductance",  "battery_resistance",     "sensor_delay"};
constexpr std::array<std::string_view, 5> need_turns{"turning_scrub", "yaw_inertia_error", "com_offset",
                                                     "track_error", "wheel_radius_asymmetry"};

// Whether the rows of these data can show an effect; with motor channels they can show all.
bool shown(const Data& d, std::string_view id) {
  if (d.motors) return true;
  if (d.witness == Witness::terminals) return id == "battery_resistance";
  if (d.witness == Witness::kinematics) return is_kinematic(id);
  return std::ranges::find(need_channels, id) == need_channels.end();
}

bool turns(std::span<const Window> windows) {
  double difference = 0, sum = 0;
  for (const Window& w : windows) {
    difference += std::fabs(w.speed_rad_s[0] - w.speed_rad_s[1]);
    sum += std::fabs(w.speed_rad_s[0]) + std::fabs(w.speed_rad_s[1]);
  }
  return difference > least_turning * sum;
}

double in_file(const Data& d, const dynamics::Effect* effect, std::size_t parameter) {
  double sum = 0;
  for (const ActiveEffect& a : d.in_file) sum += a.effect == effect ? a.values[parameter] : 0;
  return sum;
}

void bound(const Data& d, const Variant& variant, Hypothesis& h) {
  const dynamics::EffectInfo& info = h.effect.effect->info();
  const double own = in_file(d, h.effect.effect, variant.parameter);
  const bool extra =
      variant.parameter == 1 && (info.id == "viscous_friction" || info.id == "coulomb_friction");
  h.candidate.least =
      (traits_of(info.id).nonnegative || extra ? 0 : info.parameters[variant.parameter].minimum) - own;
  h.candidate.most = info.parameters[variant.parameter].maximum - own;
}

Eigen::VectorXd without(const Eigen::MatrixXd& x, const Eigen::VectorXd& y) {
  return y - x * x.colPivHouseholderQr().solve(y);
}

}  // namespace

Catalogue make_catalogue(const Data& d) {
  Catalogue c;
  const std::span<const Window> seen = d.at_readings() ? d.rows.instants : d.windows;
  const Ranges ranges = ranges_of(seen, d.mean_power_w);
  std::vector<double> speeds;
  for (const Window& w : seen) {
    for (const std::size_t s : {0u, 1u}) speeds.push_back(std::fabs(w.speed_rad_s[s]));
  }
  ShapeSetting setting{.robot = d.robot,
                       .ranges = ranges,
                       .fastest_rad_s = std::max(statistics::quantile(speeds, 0.98), 0.1),
                       .battery_alone = !d.motors && d.sides.size() == 0};
  if (ranges.position && d.power)
    setting.zones = find_zones(d, d.rows.measured_w() - predicted_power(d, d.in_file));
  const bool turning = turns(seen);
  for (const dynamics::Effect* effect : dynamics::catalogue()) {
    const std::string_view id = effect->info().id;
    if (!shown(d, id) || (!turning && std::ranges::find(need_turns, id) != need_turns.end())) continue;
    for (const Variant& variant : variants_of(*effect, setting)) {
      Hypothesis h;
      h.effect = {effect, variant.values};
      h.parameter = variant.parameter;
      for (int component = 0; component < (variant.two_components ? 2 : 1); ++component) {
        h.candidate.columns.push_back(c.columns.size());
        c.columns.push_back({h.effect, h.parameter, std::nullopt, c.hypotheses.size()});
        if (variant.two_components) c.columns.back().effect.values[1] = component * std::numbers::pi / 2;
      }
      if (variant.two_components) {
        h.candidate.least = -steepest_rad;
        h.candidate.most = steepest_rad;
      } else {
        bound(d, variant, h);
      }
      c.hypotheses.push_back(std::move(h));
    }
  }
  if (d.witness != Witness::power) {
    c.ids = dynamics::catalogue().size();
    return c;
  }
  for (const Modulation& by : modulations_of(seen)) {
    for (const std::string_view carrier : {"accessory_load", "coulomb_friction"}) {
      const std::string& name = d.covariates[by.covariate];
      // A difference from run to run may be a floor or a grease as well as a load.
      if (d.conditions.empty() && carrier != "accessory_load") continue;
      Hypothesis h;
      h.effect = dynamics::initial(*dynamics::find_effect(carrier));
      h.covariate = name;
      h.unit = std::string(h.effect.effect->info().parameters[0].unit);
      if (!signals::is_label(name)) h.unit += "/unit";
      h.by = by;
      h.candidate.columns = {c.columns.size()};
      c.columns.push_back({h.effect, 0, by, c.hypotheses.size()});
      c.hypotheses.push_back(std::move(h));
    }
  }
  return c;
}

std::vector<Zone> find_zones(const Data& d, const Eigen::VectorXd& residual_w, std::size_t most) {
  constexpr std::size_t side = 9;
  constexpr std::array radii{0.15, 0.22, 0.3};  // of the floor's extent
  constexpr std::size_t fewest = 20;
  constexpr double most_share = 0.6, apart = 0.1;
  constexpr auto moves = std::to_array<std::array<double, 3>>(
      {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}});
  const std::size_t n = d.rows.size();
  const double r = d.robot.kinematics.wheel_radius_m;
  Eigen::VectorXd x(ix(n)), y(ix(n)), travel(ix(n));
  for (std::size_t k = 0; k < n; ++k) {
    const Window& w = d.rows.window(k);
    const bool known = std::isfinite(w.x_m + w.y_m);
    x[ix(k)] = known ? w.x_m : 0;
    y[ix(k)] = known ? w.y_m : 0;
    travel[ix(k)] = known ? std::fabs(w.speed_rad_s[0] + w.speed_rad_s[1]) * r / 2 : 0;
  }
  Eigen::MatrixXd plain(ix(n), 3);
  plain << travel, Eigen::VectorXd::Ones(ix(n)), travel.cwiseAbs2();
  const Eigen::VectorXd left = without(plain, residual_w);
  const auto range = [](const Eigen::VectorXd& v) {
    const std::vector<double> all(v.begin(), v.end());
    return std::array{statistics::quantile(all, 0.02), statistics::quantile(all, 0.98)};
  };
  const auto in_x = range(x), in_y = range(y);
  const double extent = std::max({in_x[1] - in_x[0], in_y[1] - in_y[0], 0.5});
  // Score of friction within a disc, beyond that of all motion, as an explanation of the residual; 0: too few
  // rows.
  const auto score_of = [&](const Zone& zone) {
    const Eigen::ArrayXd distance =
        ((x.array() - zone.x_m).square() + (y.array() - zone.y_m).square()).sqrt();
    Eigen::VectorXd z = (distance < zone.radius_m).select(travel, 0.0);
    const auto count = static_cast<std::size_t>((z.array() > 0).count());
    if (count < fewest || static_cast<double>(count) > most_share * static_cast<double>(n)) return 0.0;
    z -= travel * (z.dot(travel) / std::max(travel.squaredNorm(), 1e-9));
    const double g = z.dot(left);
    return g * std::fabs(g) / std::max(z.squaredNorm(), 1e-9);
  };
  std::vector<std::pair<double, Zone>> found;
  for (std::size_t i = 0; i < side * side; ++i) {
    const double cx = std::lerp(in_x[0], in_x[1], static_cast<double>(i / side) / (side - 1.0));
    const double cy = std::lerp(in_y[0], in_y[1], static_cast<double>(i % side) / (side - 1.0));
    for (const double part : radii) {
      const Zone zone{cx, cy, part * extent};
      if (const double s = score_of(zone); s != 0) found.push_back({s, zone});
    }
  }
  std::ranges::stable_sort(found, std::greater(), &std::pair<double, Zone>::first);
  std::vector<Zone> zones;
  for (const auto& [score, zone] : found) {
    const bool near = std::ranges::any_of(zones, [&](const Zone& z) {
      return std::hypot(z.x_m - zone.x_m, z.y_m - zone.y_m) <= apart * extent &&
             std::fabs(z.radius_m - zone.radius_m) <= apart * extent;
    });
    if (!near) zones.push_back(zone);
    if (zones.size() == most) break;
  }
  // Moves to a better place and radius nearby, by half of the grid, a quarter and an eighth.
  for (Zone& zone : zones) {
    double most_score = score_of(zone);
    for (double step = extent / (2 * (side - 1.0)); step > extent / (10 * (side - 1.0)); step /= 2) {
      for (bool better = true; better;) {
        better = false;
        for (const auto& [dx, dy, dr] : moves) {
          const Zone moved{zone.x_m + dx * step, zone.y_m + dy * step, zone.radius_m + dr * step};
          const double s = score_of(moved);
          if (!(s > most_score)) continue;
          most_score = s;
          zone = moved;
          better = true;
        }
      }
    }
  }
  return zones;
}

std::vector<ActiveEffect> in_force(const Data& d, const Catalogue& c, const Eigen::VectorXd& strengths) {
  std::vector<ActiveEffect> effects = d.in_file;
  for (std::size_t k = 0; k < c.columns.size(); ++k) {
    if (strengths[ix(k)] == 0 || c.columns[k].by) continue;
    effects.push_back(c.columns[k].effect);
    effects.back().values[c.columns[k].parameter] = strengths[ix(k)];
  }
  return effects;
}

Eigen::VectorXd bounded(const Catalogue& c, Eigen::VectorXd strengths) {
  for (std::size_t k = 0; k < c.columns.size(); ++k) {
    const statistics::Candidate& own = c.hypotheses[c.columns[k].hypothesis].candidate;
    strengths[ix(k)] = std::clamp(strengths[ix(k)], own.least, own.most);
  }
  return strengths;
}

bool at_bound(const Hypothesis& hypothesis, double strength) {
  const auto at = [&](double end) {
    return end != 0 && std::fabs(strength - end) <= bound_part * std::fabs(end) && std::isfinite(end);
  };
  // The upper limit of a fraction, such as that of braking power that is not returned, is a valid state and
  // no bound of the search.
  const dynamics::Effect* effect = hypothesis.effect.effect;
  const bool whole = effect != nullptr && effect->info().parameters[hypothesis.parameter].name == "fraction";
  return at(hypothesis.candidate.least) || (!whole && at(hypothesis.candidate.most));
}

}  // namespace joulecast::gap::posterior
