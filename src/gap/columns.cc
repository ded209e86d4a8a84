#include "gap/columns.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

namespace joulecast::gap {
namespace {

using dynamics::ActiveEffect;
using dynamics::Effect;
using dynamics::EffectValues;

// What is expected of one effect's strength, in its own unit. tolerance: sd in a robot that is as its file
// says (0: from power alone); scatter: sd between missions; most: where its effect on power is small, the sd
// of a strength worth a name.
struct Expectation {
  std::string_view id;
  double tolerance, scatter, most;
};

constexpr auto expectations = std::to_array<Expectation>({
    {"coulomb_friction", 0.008, 0.015, 5},
    {"friction_asymmetry", 0.006, 0.010, 5},
    {"viscous_friction", 0.04, 0.03, 200},
    {"stribeck_friction", 0.02, 0, 5},
    {"chassis_mass_error", 0.006, 0, 0.6},
    {"payload_mass_error", 0.01, 0, 1},
    {"yaw_inertia_error", 0.02, 0, 3},
    {"linear_inertia_error", 0.006, 0, 1},
    {"com_offset", 0.003, 0, 0.2},
    {"resistance_error", 0.015, 0.010, 1},
    {"torque_constant_loss", 0.004, 0, 0.3},
    {"battery_resistance", 0.15, 0, 1},
    {"no_regeneration", 0.02, 0, 0.6},
    {"wheel_radius_error", 0.002, 0, 0.06},
    {"wheel_radius_asymmetry", 0.001, 0, 0.04},
    {"track_error", 0.004, 0, 0.12},
    {"wheel_slip", 0.003, 0, 0.08},
    {"current_sensor_gain", 0.004, 0, 0.1},
    {"voltage_sensor_gain", 0.003, 0, 0.1},
    {"sensor_delay", 0.004, 0, 0.1},
});

// Fractions of the mean battery power that an effect moves: when it is worth a name, and when it is not.
constexpr double expected_power = 0.07;
constexpr double unnoticed_power = 0.0025;
constexpr double unnoticed_outside = 0.0010;

// Where a gap is large, what makes it follows the catalogue's formula only so far: this part of the gap may
// look like any other effect, or like something outside, without being one.
constexpr double discrepancy = 0.03;
constexpr double discrepancy_outside = 0.03;

constexpr double effect_log_prior = -4.0;
constexpr double outside_log_prior = -6.0;

const Expectation* expectation_of(std::string_view id) {
  const auto found = std::ranges::find(expectations, id, &Expectation::id);
  return found == expectations.end() ? nullptr : &*found;
}

// Nuisances beyond the catalogue's directions: which channels they move and by how much.
enum class Extra : std::size_t {
  resistance_difference,
  viscous_difference,
  current_offset_right,
  current_offset_left,
  voltage_offset_right,
  voltage_offset_left,
  battery_level,
  battery_slope,
  gyro_bias,
  count
};
constexpr auto extra_count = static_cast<std::size_t>(Extra::count);

}  // namespace

std::optional<double> usual_strength(std::string_view effect) {
  const Expectation* known = expectation_of(effect);
  return known == nullptr ? std::nullopt : std::optional(known->most);
}

void Shapes::narrow(const ActiveEffect& effect, double wheel_radius_m, double factor) {
  const std::string_view id = effect.effect->info().id;
  const double at = effect.values[1];
  if (id == "turning_scrub") {
    scrub_rates_rad_s = {at / factor, at, at * factor};
  } else if (id == "stribeck_friction") {
    const double speed = at * wheel_radius_m;
    stribeck_speeds_m_s = {speed / factor, speed, speed * factor};
  } else if (id == "winding_temperature") {
    winding_time_constants_s = {at / factor, at, at * factor};
  }
}

ColumnSet::ColumnSet(const robot::RobotModel& robot, std::span<const Window> windows, bool power,
                     const Shapes& shapes, double gap_share)
    : robot_(robot),
      adopted_(dynamics::active_effects(robot).value_or(std::vector<ActiveEffect>{})),
      ranges_(ranges_of(windows, robot)),
      power_(power) {
  for (const Effect* effect : dynamics::catalogue()) {
    const std::string_view id = effect->info().id;
    EffectValues<double> v = dynamics::initial(*effect).values;
    if (id == "floor_resistance_zone") {
      if (!ranges_.position) continue;
      for (const Zone& zone : shapes.zones) {
        v = {0, zone.x_m, zone.y_m, zone.radius_m, 0};
        // Where it lies was searched for: that costs.
        add_effect(*effect, v, 0, static_cast<double>(shapes.zones.size()) * 50);
      }
    } else if (id == "slope") {
      if (!ranges_.heading) continue;
      v[1] = 0;
      add_effect(*effect, v, 0, 1);
      v[1] = std::numbers::pi / 2;
      columns_.emplace_back();
      column_effect_.push_back({effect, v});
      column_parameter_.push_back(0);
      hypotheses_.back().columns.push_back(columns_.size() - 1);
      hypotheses_.back().nonnegative = false;
    } else if (id == "stribeck_friction") {
      for (const double speed_m_s : shapes.stribeck_speeds_m_s) {
        v[1] = speed_m_s / robot.kinematics.wheel_radius_m;
        for (const double exponent : shapes.stribeck_exponents) {
          v[2] = exponent;
          add_effect(*effect, v, 0, 6);
        }
      }
    } else if (id == "turning_scrub") {
      for (const double rate_rad_s : shapes.scrub_rates_rad_s) {
        v[1] = rate_rad_s;
        add_effect(*effect, v, 0, 4);
      }
    } else if (id == "friction_asymmetry") {
      for (const double side : {0.0, 1.0}) {
        v[1] = side;
        add_effect(*effect, v, 0, 2);
      }
    } else if (id == "winding_temperature") {
      for (const double tau : shapes.winding_time_constants_s) {
        v[1] = tau;
        add_effect(*effect, v, 0, 6);
      }
    } else if (id == "torque_constant_loss") {
      for (const double share : {1.0, 0.0}) {
        v[1] = share;
        add_effect(*effect, v, 0, 2);
      }
    } else if (id == "payload_mass_error") {
      if (ranges_.payload_kg > 1) add_effect(*effect, v, 0, 1);
      add_effect(*effect, v, 1, 8);
    } else if (id == "current_sensor_gain" || id == "current_sensor_bias" || id == "voltage_sensor_gain") {
      for (const auto& [motors, battery] : {std::pair{1.0, 1.0}, {1.0, 0.0}, {0.0, 1.0}}) {
        v[1] = motors;
        v[2] = battery;
        if (power && motors * battery == 0) continue;  // only the battery's sensor is seen
        // The battery's sensor alone wrong, the motors' right, looks like a load that follows the current.
        add_effect(*effect, v, 0, power ? 1 : motors > 0 ? 3 : 40);
      }
    } else if (id == "load_rolling_resistance" && !(ranges_.payload_kg > 1)) {
      continue;
    } else {
      add_effect(*effect, v, 0, 1);
    }
  }

  first_extra_ = columns_.size();
  columns_.resize(columns_.size() + extra_count);
  const auto extra = [&](Extra e) -> Column& { return columns_[first_extra_ + static_cast<std::size_t>(e)]; };
  extra(Extra::resistance_difference).tolerance = 0.01;
  extra(Extra::viscous_difference).tolerance = 0.05;
  for (const Extra e : {Extra::current_offset_right, Extra::current_offset_left}) {
    extra(e).tolerance = 0.0007 * robot.limits.current_a;
  }
  for (const Extra e : {Extra::voltage_offset_right, Extra::voltage_offset_left}) {
    extra(e).tolerance = 0.0004 * robot.battery.nominal_voltage_v;
  }
  // Open-circuit voltage and how it falls with charge are only roughly known.
  extra(Extra::battery_level).scatter = 0.15 * robot.battery.nominal_voltage_v;
  extra(Extra::battery_slope).scatter =
      0.5 * robot.battery.nominal_voltage_v / (3600 * robot.battery.capacity_ah);
  extra(Extra::gyro_bias).scatter = 0.01;

  families_ = outside_families(ranges_, power);
  for (const OutsideFamily& family : families_) {
    family_first_.push_back(columns_.size());
    Hypothesis h;
    h.channel = name_of(family.channel);
    h.variable = family.variable;
    h.log_prior = outside_log_prior;
    for (std::size_t k = 0; k < family.size; ++k) h.columns.push_back(columns_.size() + k);
    columns_.resize(columns_.size() + family.size);
    hypotheses_.push_back(std::move(h));
  }
  linearise_around({});
  scale(windows, gap_share);
}

void ColumnSet::add_effect(const Effect& effect, EffectValues<double> values, std::size_t parameter,
                           double variants) {
  values[0] = 0;
  Hypothesis h;
  h.effect = {&effect, values};
  h.parameter = parameter;
  h.columns = {columns_.size()};
  const auto& info = effect.info().parameters[parameter];
  h.nonnegative = info.minimum >= 0 || effect.info().id == "wheel_slip" || effect.info().id == "sensor_delay";
  h.log_prior = effect_log_prior - std::log(variants);
  const std::string_view id = effect.info().id;
  h.one_shape = id == "turning_scrub" || id == "stribeck_friction" || id == "winding_temperature";
  columns_.emplace_back();
  column_effect_.push_back({&effect, values});
  column_parameter_.push_back(parameter);
  hypotheses_.push_back(std::move(h));
}

void ColumnSet::leave_out(const MethodParts& parts) {
  for (Column& c : columns_) {
    if (!parts.scatter) c.scatter = 0;
    if (!parts.tolerances) c.tolerance = 0;
  }
  if (!parts.open_set) {
    for (const Hypothesis& h : hypotheses_) {
      if (!h.outside()) continue;
      for (const std::size_t k : h.columns) columns_[k].tolerance = 0;
    }
    std::erase_if(hypotheses_, [](const Hypothesis& h) { return h.outside(); });
  }
}

std::vector<ActiveEffect> ColumnSet::effects_of(std::span<const Chosen> chosen) const {
  std::vector<ActiveEffect> effects;
  for (const Chosen& c : chosen) {
    const Hypothesis& h = hypotheses_[c.hypothesis];
    if (h.outside()) continue;
    ActiveEffect active = h.effect;
    if (h.columns.size() == 2) {
      active.values[0] = std::hypot(c.coefficients[0], c.coefficients[1]);
      active.values[1] = std::atan2(c.coefficients[1], c.coefficients[0]);
    } else {
      active.values[h.parameter] = c.coefficients[0];
    }
    for (std::size_t k = 0; k < active.effect->info().parameters.size(); ++k) {
      const auto& p = active.effect->info().parameters[k];
      active.values[k] = std::clamp(active.values[k], p.minimum, p.maximum);
    }
    effects.push_back(active);
  }
  return effects;
}

std::optional<Chosen> ColumnSet::coordinates_of(const ActiveEffect& effect) const {
  for (std::size_t h = 0; h < hypotheses_.size(); ++h) {
    const Hypothesis& hypothesis = hypotheses_[h];
    if (hypothesis.effect.effect != effect.effect) continue;
    if (hypothesis.columns.size() == 2) {
      return Chosen{
          h, {effect.values[0] * std::cos(effect.values[1]), effect.values[0] * std::sin(effect.values[1])}};
    }
    bool same = true;
    for (std::size_t k = 0; k < effect.effect->info().parameters.size(); ++k) {
      const double shape = hypothesis.effect.values[k];
      if (k != hypothesis.parameter)
        same = same && std::fabs(shape - effect.values[k]) <= 1e-6 * (1 + std::fabs(shape));
    }
    if (same) return Chosen{h, {effect.values[hypothesis.parameter]}};
  }
  return std::nullopt;
}

void ColumnSet::linearise_around(std::span<const Chosen> chosen) {
  std::vector<ActiveEffect> effects = adopted_;
  for (const ActiveEffect& effect : effects_of(chosen)) effects.push_back(effect);
  base_.assign(1, dynamics::DriveModel(robot_, effects));
  offset_.assign(columns_.size(), 0.0);
  derivatives_.clear();
  std::vector<std::size_t> seeded(columns_.size(), effects.size());
  std::size_t at = adopted_.size();
  for (const Chosen& c : chosen) {
    const Hypothesis& h = hypotheses_[c.hypothesis];
    for (std::size_t k = 0; k < h.columns.size(); ++k) offset_[h.columns[k]] = c.coefficients[k];
    if (h.outside()) continue;
    if (h.columns.size() == 1) seeded[h.columns[0]] = at;
    ++at;
  }
  for (std::size_t k = 0; k < column_effect_.size(); ++k) {
    if (seeded[k] < effects.size()) {
      derivatives_.push_back({k, {robot_, effects, seeded[k], column_parameter_[k]}});
    } else {
      effects.push_back(column_effect_[k]);
      derivatives_.push_back({k, {robot_, effects, effects.size() - 1, column_parameter_[k]}});
      effects.pop_back();
    }
  }
}

void ColumnSet::evaluate(const Window& w, ChannelValues<double>& values, std::span<double> rows) const {
  const std::size_t n = columns_.size();
  std::ranges::fill(rows, 0.0);
  values = residuals(base_[0], w, power_);
  const auto cell = [&](Channel channel, std::size_t column) -> double& {
    return rows[index_of(channel) * n + column];
  };
  for (const Derivative& d : derivatives_) {
    const ChannelValues<dynamics::Dual> r = residuals(d.model, w, power_);
    for (std::size_t c = 0; c < channel_count; ++c) {
      if (std::isfinite(values[c]) && std::isfinite(r[c].slope)) rows[c * n + d.column] = -r[c].slope;
    }
  }
  const auto extra = [&](Channel channel, Extra e) -> double& {
    return cell(channel, first_extra_ + static_cast<std::size_t>(e));
  };
  const double kt = robot_.motor.torque_constant_nm_a * robot_.motor.gear_ratio;
  const double ohm = robot_.motor.resistance_ohm, nu = robot_.motor.viscous_friction_nm_s_rad;
  for (std::size_t s : {0u, 1u}) {
    const auto voltage = static_cast<Channel>(s), torque = static_cast<Channel>(2 + s);
    const double half = s == 0 ? 0.5 : -0.5;
    if (std::isfinite(values[index_of(voltage)])) {
      extra(voltage, Extra::resistance_difference) = half * ohm * w.current_a[s];
      extra(voltage, s == 0 ? Extra::voltage_offset_right : Extra::voltage_offset_left) = 1;
      extra(voltage, s == 0 ? Extra::current_offset_right : Extra::current_offset_left) = -ohm;
    }
    if (std::isfinite(values[index_of(torque)])) {
      extra(torque, Extra::viscous_difference) = half * nu * w.speed_rad_s[s] / kt;
      extra(torque, s == 0 ? Extra::current_offset_right : Extra::current_offset_left) = 1;
    }
  }
  extra(Channel::battery_voltage, Extra::battery_level) = 1;
  extra(Channel::battery_voltage, Extra::battery_slope) = -w.charge_as;
  extra(Channel::gyro, Extra::gyro_bias) = 1;
  for (std::size_t f = 0; f < families_.size(); ++f) {
    const OutsideFamily& family = families_[f];
    const bool paired = family.channel == Channel::torque_right || family.channel == Channel::voltage_right;
    for (std::size_t s = 0; s < (paired ? 2u : 1u); ++s) {
      const std::size_t c = index_of(family.channel) + s;
      if (!std::isfinite(values[c])) continue;
      family.values(w, ranges_, s, rows.subspan(c * n + family_first_[f], family.size));
    }
  }
  // What the chosen coefficients explain stays in the response.
  for (std::size_t c = 0; c < channel_count; ++c) {
    if (!std::isfinite(values[c])) continue;
    for (std::size_t k = 0; k < n; ++k) {
      if (offset_[k] != 0) values[c] += offset_[k] * rows[c * n + k];
    }
  }
}

void ColumnSet::scale(std::span<const Window> windows, double gap_share) {
  const std::size_t stride = std::max<std::size_t>(1, windows.size() / 2000);
  std::size_t count = 0;
  double torque_power = 0, voltage_power = 0;  // W of battery for 1 N m at each wheel, for 1 V on each motor
  const double kt = robot_.motor.torque_constant_nm_a * robot_.motor.gear_ratio;
  for (std::size_t k = 0; k < windows.size(); k += stride) {
    const Window& w = windows[k];
    ++count;
    const dynamics::PowerFlow<double> flow = [&] {
      dynamics::Instant at;
      at.wheel_speed_rad_s = w.speed_rad_s;
      at.wheel_acceleration_rad_s2 = w.acceleration_rad_s2;
      at.payload_kg = w.payload_kg;
      return base_[0].flow(at);
    }();
    mean_power_w_ += std::fabs(std::isfinite(w.battery_power_w) ? w.battery_power_w : flow.battery_power_w);
    for (std::size_t s : {0u, 1u}) {
      if (!w.moving[s]) continue;
      torque_power +=
          std::fabs(w.speed_rad_s[s]) + 2 * robot_.motor.resistance_ohm * std::fabs(flow.current_a[s]) / kt;
      voltage_power += std::fabs(flow.current_a[s]);
    }
    for (const Derivative& d : derivatives_) {
      const double slope = metered_power(d.model, w).slope;
      if (std::isfinite(slope)) columns_[d.column].power_w += std::fabs(slope);
    }
  }
  const double n = static_cast<double>(std::max<std::size_t>(1, count));
  mean_power_w_ = std::max(mean_power_w_ / n, 1e-3);
  torque_power /= n;
  voltage_power /= n;
  for (Column& c : columns_) c.power_w /= n;

  for (Hypothesis& h : hypotheses_) {
    if (h.outside()) continue;
    const Expectation* known = expectation_of(h.effect.effect->info().id);
    for (const std::size_t k : h.columns) {
      Column& c = columns_[k];
      const double by_power =
          c.power_w > 0 ? mean_power_w_ / c.power_w : std::numeric_limits<double>::infinity();
      c.tolerance = unnoticed_power * by_power;
      const bool own_unit = h.parameter == 0;
      h.expected = expected_power * by_power;
      if (known != nullptr && own_unit) {
        c.tolerance = std::min(std::max(known->tolerance, 0.0), 0.02 * by_power);
        if (h.effect.effect->info().id == "viscous_friction")
          c.tolerance = std::max(c.tolerance, 0.002 * by_power);
        c.scatter = known->scatter;
        h.expected = std::min(h.expected, known->most);
      }
      const bool by_power_alone = known == nullptr || !own_unit || expected_power * by_power < known->most;
      if (by_power_alone) c.tolerance = std::hypot(c.tolerance, discrepancy * gap_share * by_power);
      if (h.effect.effect->info().id == "accessory_load") {
        c.tolerance =
            std::hypot(0.006 * robot_.idle_power_w, (0.0005 + discrepancy * gap_share) * mean_power_w_);
        c.scatter = 0.008 * robot_.idle_power_w;
      }
      if (h.id() == "battery_resistance") {
        // Steps of the reading as large as the sag make any resistance of it.
        const double sag_v = robot_.battery.internal_resistance_ohm * ranges_.battery_current_a;
        if (sag_v > 0) c.tolerance = std::hypot(c.tolerance, 2 * ranges_.battery_voltage_step_v / sag_v);
      }
      // Shapes of one effect are nearly one column: together they are off by what one of them may be.
      if (h.one_shape) {
        const auto shapes = std::ranges::count_if(
            hypotheses_, [&](const Hypothesis& other) { return other.effect.effect == h.effect.effect; });
        c.tolerance /= std::sqrt(static_cast<double>(shapes));
      }
      if (!std::isfinite(c.tolerance)) c.tolerance = 1e-3;
      if (!std::isfinite(h.expected)) h.expected = 1;
    }
  }
  for (std::size_t f = 0; f < families_.size(); ++f) {
    double unit = mean_power_w_;  // coefficient that moves the mean power by all of it
    switch (families_[f].channel) {
      case Channel::torque_right:
        unit = mean_power_w_ / std::max(kt * torque_power, 1e-9);
        break;
      case Channel::voltage_right:
        unit = mean_power_w_ / std::max(voltage_power, 1e-9);
        break;
      case Channel::gyro:
        unit = ranges_.yaw_rate_rad_s;
        break;
      case Channel::travel:
        unit = ranges_.speed_m_s;
        break;
      default:
        break;
    }
    for (Hypothesis& h : hypotheses_) {
      if (!h.outside() || h.columns.front() != family_first_[f]) continue;
      h.expected = expected_power * unit;
      for (const std::size_t k : h.columns) {
        columns_[k].tolerance = std::hypot(unnoticed_outside, discrepancy_outside * gap_share) * unit;
        columns_[k].power_w = mean_power_w_ / unit;
      }
    }
  }
}

}  // namespace joulecast::gap
