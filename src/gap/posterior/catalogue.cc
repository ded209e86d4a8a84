#include "gap/posterior/catalogue.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "gap/traits.h"
#include "signals/covariates.h"
#include "statistics/robust.h"

namespace joulecast::gap {

std::vector<Modulation> modulations_of(std::span<const Window> windows) {
  std::vector<Modulation> modulations;
  const std::size_t count = windows.empty() ? 0 : windows.front().covariates.size();
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<double> known;
    for (const Window& w : windows)
      if (std::isfinite(w.covariates[k])) known.push_back(w.covariates[k]);
    if (2 * known.size() < windows.size()) continue;
    // The origin is 0 of an amount, which is never negative and comes near 0 relative to its range, such as a
    // load in W or a share of a processor; else the median.
    constexpr double near_zero = 0.5;  // of the range of a covariate
    const auto [least, most] = std::ranges::minmax(known);
    if (least == most) continue;
    const bool amount = least >= 0 && least < near_zero * (most - least);
    modulations.push_back({k, amount ? 0 : statistics::median(std::move(known))});
  }
  return modulations;
}

}  // namespace joulecast::gap

namespace joulecast::gap::posterior {
namespace {

using dynamics::ActiveEffect;
using Values = dynamics::EffectValues<double>;

constexpr double steepest_rad = 0.3;
constexpr double least_turning = 0.02;  // of the wheels' speeds: less does not count as turning
// Strengths that are ratios to a parameter of the robot file are undefined where that is close to zero: there
// the effect's own parameter is used. A parameter is close to zero if ten times its value moves less than
// this part of the mean power.
constexpr double least_share = 0.01, tenfold = 10;
constexpr std::array stribeck_parts{0.05, 0.1, 0.2, 0.4};  // of the fastest wheel speed
constexpr std::array scrub_rates_rad_s{0.02, 0.2};
constexpr std::array winding_s{120.0, 480.0};

constexpr auto kinematic = std::to_array<std::string_view>(
    {"wheel_radius_error", "wheel_radius_asymmetry", "track_error", "wheel_slip", "com_offset"});
// Effects that battery power alone does not show, or that must be visible in other channels.
constexpr std::array<std::string_view, 8> need_channels{
    "track_error", "wheel_radius_asymmetry", "com_offset",  "wheel_slip", "winding_temperature",
    "inductance",  "battery_resistance",     "sensor_delay"};
constexpr std::array<std::string_view, 5> need_turns{"turning_scrub", "yaw_inertia_error", "com_offset",
                                                     "track_error", "wheel_radius_asymmetry"};

bool contains(std::span<const std::string_view> ids, std::string_view id) {
  return std::ranges::find(ids, id) != ids.end();
}

// Whether the rows of these data can show an effect; with motor channels they can show all.
bool shown(const Data& d, std::string_view id) {
  if (d.motors) return true;
  if (d.witness == Witness::terminals) return id == "battery_resistance";
  return d.witness == Witness::kinematics ? contains(kinematic, id) : !contains(need_channels, id);
}

// Sizes and kinds of the recorded motion.
struct Motion {
  double mean_rad_s = 0, fastest_rad_s = 0.1;  // of a wheel; fastest: 98 %
  double payload_kg = 0;
  bool position = false, heading = false, climb = false, turning = false;
};

Motion motion_of(std::span<const Window> windows) {
  Motion m;
  std::vector<double> speeds;
  double difference = 0, sum = 0;
  for (const Window& w : windows) {
    for (const double speed : w.speed_rad_s) {
      speeds.push_back(std::fabs(speed));
      m.mean_rad_s += 0.5 * std::fabs(speed) / static_cast<double>(windows.size());
    }
    difference += std::fabs(w.speed_rad_s[0] - w.speed_rad_s[1]);
    sum += std::fabs(w.speed_rad_s[0]) + std::fabs(w.speed_rad_s[1]);
    m.payload_kg = std::max(m.payload_kg, w.payload_kg);
    m.position = m.position || std::isfinite(w.x_m + w.y_m);
    m.heading = m.heading || std::isfinite(w.heading_rad);
    m.climb = m.climb || std::fabs(w.climb_rad) > 0;
  }
  m.fastest_rad_s = std::max(statistics::quantile(std::move(speeds), 0.98), m.fastest_rad_s);
  m.turning = difference > least_turning * sum;
  return m;
}

// A disc of the floor.
struct Zone {
  double x_m = 0, y_m = 0, radius_m = 0;
};

// One form in which an effect may be present: all parameters but the strength, and which of them that is.
struct Shape {
  Values values;
  std::size_t strength = 0;
};

// The forms in which these recordings could show an effect; empty where they cannot.
std::vector<Shape> shapes_of(const dynamics::Effect& effect, const Data& d, const Motion& motion,
                             std::span<const Zone> zones) {
  const std::string_view id = effect.info().id;
  Values v = dynamics::initial(effect).values;
  v[0] = 0;
  std::vector<Shape> shapes;
  const auto by_second = [&](std::span<const double> values) {
    for (const double value : values) v[1] = value, shapes.push_back({v});
    return shapes;
  };
  const auto ratio_or_own = [&](double nominal_w) -> std::vector<Shape> {
    return {{v, tenfold * nominal_w > least_share * d.mean_power_w ? std::size_t{0} : std::size_t{1}}};
  };
  const robot::Motor& motor = d.robot.motor;
  if (id == "floor_resistance_zone") {
    for (const Zone& zone : zones) shapes.push_back({{0, zone.x_m, zone.y_m, zone.radius_m, 0}});
    return shapes;
  }
  if (id == "coulomb_friction")
    return ratio_or_own((motor.friction_torque_nm[0] + motor.friction_torque_nm[1]) * motion.mean_rad_s);
  if (id == "viscous_friction")
    return ratio_or_own(2 * motor.viscous_friction_nm_s_rad * motion.mean_rad_s * motion.mean_rad_s);
  if (id == "stribeck_friction") {
    const dynamics::EffectParameter& bounds = effect.info().parameters[1];
    for (const double part : stribeck_parts) {
      v[1] = part * motion.fastest_rad_s;
      v[2] = 2;
      if (v[1] >= bounds.minimum && v[1] <= bounds.maximum) shapes.push_back({v});
    }
    return shapes;
  }
  if (id == "turning_scrub") return by_second(scrub_rates_rad_s);
  if (id == "winding_temperature") return by_second(winding_s);
  if (id == "friction_asymmetry" || id == "torque_constant_loss" || id == "gear_efficiency")
    return by_second(std::array{1.0, 0.0});
  if (id == "payload_mass_error") {
    shapes.push_back({v, 1});
    if (motion.payload_kg > 1) shapes.push_back({v});
    return shapes;
  }
  // Both motors' and the battery's sensors, the motors' alone and the battery's alone.
  if (id == "current_sensor_gain" || id == "current_sensor_bias" || id == "voltage_sensor_gain") {
    const bool battery_alone = !d.motors && d.sides.size() == 0;
    for (const auto& [of_motors, of_battery] : {std::pair{1.0, 1.0}, {1.0, 0.0}, {0.0, 1.0}}) {
      v[1] = of_motors;
      v[2] = of_battery;
      if (!battery_alone || of_motors * of_battery != 0) shapes.push_back({v});
    }
    return shapes;
  }
  const bool absent = (id == "slope" && !motion.heading) || (id == "grade" && !motion.climb) ||
                      (id == "load_rolling_resistance" && !(motion.payload_kg > 1));
  if (!absent) shapes.push_back({v});
  return shapes;
}

// Bounds of the strength beyond the robot file's own.
void bound(const Data& d, Hypothesis& h) {
  const dynamics::EffectInfo& info = h.effect.effect->info();
  double own = 0;
  for (const ActiveEffect& a : d.in_file) own += a.effect == h.effect.effect ? a.values[h.parameter] : 0;
  const bool extra = h.parameter == 1 && (info.id == "viscous_friction" || info.id == "coulomb_friction");
  h.least = (traits_of(info.id).nonnegative || extra ? 0 : info.parameters[h.parameter].minimum) - own;
  h.most = info.parameters[h.parameter].maximum - own;
}

// Discs of the floor, at most `most`, in which the residual of power is largest beyond a constant, friction
// and speed.
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
  const Eigen::VectorXd left = residual_w - plain * plain.colPivHouseholderQr().solve(residual_w);
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

}  // namespace

Catalogue make_catalogue(const Data& d) {
  Catalogue c;
  const std::span<const Window> seen = d.at_readings() ? d.rows.instants : d.windows;
  const Motion motion = motion_of(seen);
  std::vector<Zone> zones;
  if (motion.position && d.power)
    zones = find_zones(d, d.rows.measured_w() - predicted_power(d, d.in_file), 3);
  for (const dynamics::Effect* effect : dynamics::catalogue()) {
    const std::string_view id = effect->info().id;
    if (!shown(d, id) || (!motion.turning && contains(need_turns, id))) continue;
    for (const Shape& shape : shapes_of(*effect, d, motion, zones)) {
      Hypothesis h;
      h.effect = {effect, shape.values};
      h.parameter = shape.strength;
      // A slope has a column for each of two headings, a quarter turn apart.
      for (const double heading : {0.0, std::numbers::pi / 2}) {
        if (heading > 0 && id != "slope") break;
        h.columns.push_back(c.columns.size());
        c.columns.push_back({{h.effect, h.parameter, std::nullopt}, c.hypotheses.size()});
        if (id == "slope") c.columns.back().effect.values[1] = heading;
      }
      if (id == "slope")
        h.least = -steepest_rad, h.most = steepest_rad;
      else
        bound(d, h);
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
      h.columns = {c.columns.size()};
      c.columns.push_back({{h.effect, 0, by}, c.hypotheses.size()});
      c.hypotheses.push_back(std::move(h));
    }
  }
  return c;
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
    const Hypothesis& own = c.hypotheses[c.columns[k].hypothesis];
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
  return at(hypothesis.least) || (!whole && at(hypothesis.most));
}

}  // namespace joulecast::gap::posterior
