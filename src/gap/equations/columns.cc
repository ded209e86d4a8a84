#include "gap/equations/columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string_view>

#include "gap/traits.h"
#include "signals/covariates.h"

namespace joulecast::gap {
namespace {

using dynamics::ActiveEffect;
using dynamics::Dual;
using dynamics::Effect;

// Of the mean battery power: what an effect moves in a robot as filed where its traits name no tolerance, and
// what functions outside the catalogue do.
constexpr double unnoticed_share = 0.0025;
constexpr double unnoticed_outside = 0.0010;
constexpr double most_tolerance_share = 0.02, least_viscous_share = 0.002;

constexpr double effect_log_prior = -4.0;
constexpr double outside_log_prior = -6.0;

constexpr std::size_t most_measured = 400;  // windows, to learn what columns move

// What calibration leaves beyond the catalogue's directions: which channels they move and by how much.
enum class Nuisance : std::size_t {
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
constexpr auto nuisance_count = static_cast<std::size_t>(Nuisance::count);

constexpr bool paired(Channel channel) {
  return channel == Channel::torque_right || channel == Channel::voltage_right ||
         channel == Channel::drive_right;
}

}  // namespace

bool Hypothesis::excludes(const Hypothesis& other) const {
  if (!is_effect() || !other.is_effect()) return id() == other.id();
  // Slip and a smaller wheel are one thing to every channel but the inertia's.
  const auto rolls_less = [](const Hypothesis& h) {
    return h.id() == "wheel_slip" || h.id() == "wheel_radius_error";
  };
  return effect.effect == other.effect.effect || (rolls_less(*this) && rolls_less(other));
}

ColumnSet::ColumnSet(const Material& m, const Shapes& shapes, std::span<const double> shares)
    : robot_(m.robot),
      adopted_(m.adopted.begin(), m.adopted.end()),
      ranges_(ranges_of(m.windows, m.robot)),
      from_motion_(m.from_motion),
      row_s_(m.row_s) {
  add_effects(shapes, shares);
  add_covariates(m, shares);
  add_nuisances();
  add_families(shares);
  linearise_around({});
  measure(m.windows);
  scale_effects(shares);
  scale_covariates(shares);
  scale_families(shares);
  for (Column& c : columns_) {
    c.tolerance *= m.prior_factor;
    c.scatter *= m.prior_factor;
  }
}

void ColumnSet::add_effects(const Shapes& shapes, std::span<const double> shares) {
  const ShapeSetting setting{robot_, ranges_, shapes, from_motion_};
  for (const Effect* effect : dynamics::catalogue()) {
    const Traits& traits = traits_of(effect->info().id);
    for (const Variant& variant : variants_of(*effect, setting)) {
      Hypothesis h;
      h.effect = {effect, variant.values};
      h.parameter = variant.parameter;
      h.one_shape = traits.one_shape;
      h.candidate.log_prior =
          effect_log_prior - std::log(variant.against * static_cast<double>(shares.size()));
      for (int component = 0; component < (variant.two_components ? 2 : 1); ++component) {
        h.candidate.columns.push_back(columns_.size());
        columns_.emplace_back();
        column_effect_.push_back(h.effect);
        if (variant.two_components) column_effect_.back().values[1] = component * std::numbers::pi / 2;
        column_parameter_.push_back(h.parameter);
      }
      if (!variant.two_components) {
        // Bounds are of what the robot file has and what is found, together.
        const auto& info = effect->info().parameters[h.parameter];
        double in_file = 0;
        for (const ActiveEffect& a : adopted_) {
          if (a.effect == effect) in_file += a.values[h.parameter];
        }
        h.candidate.least = (traits.nonnegative ? 0 : info.minimum) - in_file;
        h.candidate.most = info.maximum - in_file;
        // A friction of its own stands in where the robot file's is next to none: less than none it cannot
        // be.
        if (h.parameter == 1 &&
            (effect->info().id == "viscous_friction" || effect->info().id == "coulomb_friction"))
          h.candidate.least = -in_file;
        if (effect->info().id == "accessory_load")
          h.candidate.least = std::max(h.candidate.least, -robot_.idle_power_w - in_file);
      }
      for (std::size_t k = 0; k < shares.size(); ++k) hypotheses_.push_back(h);
    }
  }
}

// A covariate may be a load's or a friction's cause.
void ColumnSet::add_covariates(const Material& m, std::span<const double> shares) {
  constexpr std::array<std::string_view, 2> carriers{"accessory_load", "coulomb_friction"};
  const std::vector<Hypothesis> effects = hypotheses_;
  for (const Modulation& by : modulations_of(m.windows)) {
    for (const std::string_view id : carriers) {
      const auto carrier = std::ranges::find_if(effects, [&](const Hypothesis& h) { return h.id() == id; });
      if (carrier == effects.end()) continue;
      Hypothesis h;
      h.effect = carrier->effect;
      h.parameter = carrier->parameter;
      h.covariate = m.covariates[by.covariate];
      h.by = by;
      const std::string_view unit = h.effect.effect->info().parameters[h.parameter].unit;
      h.unit = signals::is_label(h.covariate) ? std::string(unit)
                                              : fmt::format("{}/unit", unit.empty() ? "1" : unit);
      h.candidate.log_prior =
          effect_log_prior - std::log(static_cast<double>(carriers.size() * shares.size()));
      h.candidate.columns = {columns_.size()};
      followed_.push_back({columns_.size(), carrier->candidate.columns.front(), by});
      columns_.emplace_back();
      for (std::size_t k = 0; k < shares.size(); ++k) hypotheses_.push_back(h);
    }
  }
}

void ColumnSet::add_nuisances() {
  first_nuisance_ = columns_.size();
  columns_.resize(columns_.size() + nuisance_count);
  const auto nuisance = [&](Nuisance n) -> Column& {
    return columns_[first_nuisance_ + static_cast<std::size_t>(n)];
  };
  nuisance(Nuisance::resistance_difference).tolerance = 0.01;
  nuisance(Nuisance::viscous_difference).tolerance = 0.05;
  for (const Nuisance n : {Nuisance::current_offset_right, Nuisance::current_offset_left})
    nuisance(n).tolerance = 0.0007 * robot_.limits.current_a;
  for (const Nuisance n : {Nuisance::voltage_offset_right, Nuisance::voltage_offset_left})
    nuisance(n).tolerance = 0.0004 * robot_.battery.nominal_voltage_v;
  // Open-circuit voltage and how it falls with charge are only roughly known.
  nuisance(Nuisance::battery_level).scatter = 0.15 * robot_.battery.nominal_voltage_v;
  nuisance(Nuisance::battery_slope).scatter =
      0.5 * robot_.battery.nominal_voltage_v / (3600 * robot_.battery.capacity_ah);
  nuisance(Nuisance::gyro_bias).scatter = 0.01;
}

void ColumnSet::add_families(std::span<const double> shares) {
  families_ = outside_families(ranges_, from_motion_);
  for (const OutsideFamily& family : families_) {
    family_first_.push_back(columns_.size());
    Hypothesis h;
    h.channel = name_of(family.channel);
    h.variable = family.variable;
    h.candidate.log_prior = outside_log_prior - std::log(static_cast<double>(shares.size()));
    for (std::size_t k = 0; k < family.size; ++k) h.candidate.columns.push_back(columns_.size() + k);
    columns_.resize(columns_.size() + family.size);
    for (std::size_t k = 0; k < shares.size(); ++k) hypotheses_.push_back(h);
  }
}

std::vector<Cause> ColumnSet::causes_of(std::span<const Chosen> chosen) const {
  std::vector<Cause> causes;
  for (const Chosen& c : chosen) {
    const Hypothesis& h = hypotheses_[c.hypothesis];
    if (h.outside()) continue;
    Cause cause = h.cause();
    auto& values = cause.effect.values;
    if (h.candidate.columns.size() == 2) {
      values[0] = std::hypot(c.coefficients[0], c.coefficients[1]);
      values[1] = std::atan2(c.coefficients[1], c.coefficients[0]);
    } else {
      values[h.parameter] = c.coefficients[0];
    }
    for (std::size_t k = 0; !cause.by && k < cause.effect.effect->info().parameters.size(); ++k) {
      const auto& p = cause.effect.effect->info().parameters[k];
      // A strength may be what takes off some of the robot file's.
      const bool bounded = k == h.parameter && h.candidate.columns.size() == 1;
      values[k] = std::clamp(values[k], bounded ? h.candidate.least : p.minimum,
                             bounded ? h.candidate.most : p.maximum);
    }
    causes.push_back(cause);
  }
  return causes;
}

std::optional<Chosen> ColumnSet::coordinates_of(const Cause& cause) const {
  const auto& values = cause.effect.values;
  for (std::size_t h = 0; h < hypotheses_.size(); ++h) {
    const Hypothesis& hypothesis = hypotheses_[h];
    if (hypothesis.outside() || !hypothesis.cause().same_kind(cause)) continue;
    if (hypothesis.candidate.columns.size() == 2)
      return Chosen{h, {values[0] * std::cos(values[1]), values[0] * std::sin(values[1])}};
    bool same = true;
    for (std::size_t k = 0; k < cause.effect.effect->info().parameters.size(); ++k) {
      const double shape = hypothesis.effect.values[k];
      if (k != hypothesis.parameter)
        same = same && std::fabs(shape - values[k]) <= 1e-6 * (1 + std::fabs(shape));
    }
    if (same) return Chosen{h, {values[hypothesis.parameter]}};
  }
  return std::nullopt;
}

void ColumnSet::linearise_around(std::span<const Chosen> chosen) {
  std::vector<ActiveEffect> effects = adopted_;
  for (const Cause& cause : causes_of(chosen)) {
    if (!cause.by) effects.push_back(cause.effect);
  }
  base_.assign(1, dynamics::DriveModel(robot_, effects));
  offset_.assign(columns_.size(), 0.0);
  derivatives_.clear();
  std::vector<std::size_t> seeded(columns_.size(), effects.size());
  std::size_t at = adopted_.size();
  for (const Chosen& c : chosen) {
    const Hypothesis& h = hypotheses_[c.hypothesis];
    if (!h.is_effect()) continue;  // what follows a covariate stays in the response by itself
    const auto& own = h.candidate.columns;
    for (std::size_t k = 0; k < own.size(); ++k) offset_[own[k]] = c.coefficients[k];
    if (own.size() == 1) seeded[own[0]] = at;
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

void ColumnSet::differentiate_only(std::span<const std::string_view> effects) {
  std::erase_if(derivatives_, [&](const Derivative& d) {
    return std::ranges::find(effects, column_effect_[d.column].effect->info().id) == effects.end();
  });
}

void ColumnSet::evaluate(const Window& w, ChannelValues<double>& values, std::span<double> rows) const {
  const std::size_t n = columns_.size();
  std::ranges::fill(rows, 0.0);
  values = residuals(base_[0], w, from_motion_);
  const auto cell = [&](Channel channel, std::size_t column) -> double& {
    return rows[index_of(channel) * n + column];
  };
  for (const Derivative& d : derivatives_) {
    const ChannelValues<Dual> r = residuals(d.model, w, from_motion_);
    for (std::size_t c = 0; c < channel_count; ++c) {
      if (std::isfinite(values[c]) && std::isfinite(r[c].slope)) rows[c * n + d.column] = -r[c].slope;
    }
  }
  for (const Followed& f : followed_) {
    const double by = f.by.of(w);
    for (std::size_t c = 0; c < channel_count; ++c) rows[c * n + f.column] = by * rows[c * n + f.carrier];
  }
  const auto nuisance = [&](Channel channel, Nuisance e) -> double& {
    return cell(channel, first_nuisance_ + static_cast<std::size_t>(e));
  };
  const double kt = robot_.motor.torque_constant_nm_a * robot_.motor.gear_ratio;
  const double ohm = robot_.motor.resistance_ohm, nu = robot_.motor.viscous_friction_nm_s_rad;
  for (const std::size_t s : {0u, 1u}) {
    const auto side = [s](Channel right) { return static_cast<Channel>(index_of(right) + s); };
    const double half = s == 0 ? 0.5 : -0.5;
    const Nuisance current = s == 0 ? Nuisance::current_offset_right : Nuisance::current_offset_left;
    const Nuisance voltage = s == 0 ? Nuisance::voltage_offset_right : Nuisance::voltage_offset_left;
    if (const Channel c = side(Channel::voltage_right); std::isfinite(values[index_of(c)])) {
      nuisance(c, Nuisance::resistance_difference) = half * ohm * w.current_a[s];
      nuisance(c, voltage) = 1;
      nuisance(c, current) = -ohm;
    }
    if (const Channel c = side(Channel::torque_right); std::isfinite(values[index_of(c)])) {
      nuisance(c, Nuisance::viscous_difference) = half * nu * w.speed_rad_s[s] / kt;
      nuisance(c, current) = 1;
    }
    if (const Channel c = side(Channel::drive_right); std::isfinite(values[index_of(c)])) {
      nuisance(c, Nuisance::viscous_difference) = half * ohm * nu * w.speed_rad_s[s] / kt;
      nuisance(c, voltage) = 1;
    }
  }
  nuisance(Channel::battery_voltage, Nuisance::battery_level) = 1;
  nuisance(Channel::battery_voltage, Nuisance::battery_slope) = -w.charge_as;
  nuisance(Channel::gyro, Nuisance::gyro_bias) = 1;
  for (std::size_t f = 0; f < families_.size(); ++f) {
    const OutsideFamily& family = families_[f];
    for (std::size_t s = 0; s < (paired(family.channel) ? 2u : 1u); ++s) {
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

void ColumnSet::measure(std::span<const Window> windows) {
  const std::size_t stride = std::max<std::size_t>(1, windows.size() / most_measured);
  const double kt = robot_.motor.torque_constant_nm_a * robot_.motor.gear_ratio;
  double count = 0;
  for (std::size_t k = 0; k < windows.size(); k += stride) {
    const Window& w = windows[k];
    dynamics::Instant at;
    at.wheel_speed_rad_s = w.speed_rad_s;
    at.wheel_acceleration_rad_s2 = w.acceleration_rad_s2;
    at.payload_kg = w.payload_kg;
    const auto flow = base_[0].flow(at);
    for (const std::size_t s : {0u, 1u}) {
      mean_motor_power_w_ +=
          std::fabs(std::isfinite(w.motor_power_w[s]) ? w.motor_power_w[s] : flow.motor_power_w[s]);
      if (!w.moving[s]) continue;
      torque_power_w_ +=
          std::fabs(w.speed_rad_s[s]) + 2 * robot_.motor.resistance_ohm * std::fabs(flow.current_a[s]) / kt;
      voltage_power_w_ += std::fabs(flow.current_a[s]);
    }
    for (const Derivative& d : derivatives_) {
      const auto power = metered_powers(d.model, w);
      const auto add = [&](std::size_t column, double times) {
        if (std::isfinite(power.battery_w.slope))
          columns_[column].power_share += times * std::fabs(power.battery_w.slope);
        if (std::isfinite(power.motors_w.slope) && !from_motion_.power)
          columns_[column].motor_share += times * std::fabs(power.motors_w.slope);
      };
      add(d.column, 1);
      for (const Followed& f : followed_) {
        if (f.carrier == d.column) add(f.column, std::fabs(f.by.of(w)));
      }
    }
    ++count;
  }
  count = std::max(1.0, count);
  mean_power_w_ = ranges_.mean_power_w;
  mean_motor_power_w_ = std::max(mean_motor_power_w_ / count, 1e-3);
  torque_power_w_ /= count;
  voltage_power_w_ /= count;
  for (Column& c : columns_) {
    c.power_share /= count * mean_power_w_;
    c.motor_share /= count * mean_motor_power_w_;
  }
}

void ColumnSet::scale_effects(std::span<const double> shares) {
  std::size_t turn = 0;  // which of the shares a hypothesis is for: they follow each other
  for (Hypothesis& h : hypotheses_) {
    if (!h.is_effect()) continue;
    const double share = shares[turn++ % shares.size()];
    const Traits& traits = traits_of(h.id());
    const bool in_own_unit = h.parameter == 0;
    for (const std::size_t k : h.candidate.columns) {
      Column& c = columns_[k];
      const double by_power = c.power_share > 0 ? 1 / c.power_share : std::numeric_limits<double>::infinity();
      c.tolerance = unnoticed_share * by_power;
      c.discrepancy = std::isfinite(by_power) ? by_power : 0;
      h.candidate.expected = share * by_power;
      if (in_own_unit && traits.usual > 0) {
        c.tolerance = std::min(traits.tolerance, most_tolerance_share * by_power);
        if (h.id() == "viscous_friction") c.tolerance = std::max(c.tolerance, least_viscous_share * by_power);
        c.scatter = traits.scatter;
        h.candidate.expected = std::min(h.candidate.expected, traits.usual);
        if (share * by_power >= traits.usual) c.discrepancy = 0;
      }
      if (h.id() == "accessory_load") {
        c.tolerance = std::hypot(0.006 * robot_.idle_power_w, 0.0005 * mean_power_w_);
        c.scatter = 0.008 * robot_.idle_power_w;
      }
      // Rows are stamped to a period, evenly: whatever is read in it bears the stamp of its row.
      if (h.id() == "sensor_delay") c.tolerance = std::hypot(c.tolerance, row_s_ / std::sqrt(12.0));
      if (h.id() == "battery_resistance") {
        // Steps of the reading as large as the sag make any resistance of it.
        const double sag_v = robot_.battery.internal_resistance_ohm * ranges_.battery_current_a;
        if (sag_v > 0) c.tolerance = std::hypot(c.tolerance, 2 * ranges_.battery_voltage_step_v / sag_v);
      }
      if (!std::isfinite(c.tolerance)) c.tolerance = 1e-3;
      if (!std::isfinite(h.candidate.expected)) h.candidate.expected = 1;
    }
  }
  // Shapes of one effect are nearly one column: together they are off by what one of them may be.
  for (std::size_t k = 0; k < column_effect_.size(); ++k) {
    if (!traits_of(column_effect_[k].effect->info().id).one_shape) continue;
    const auto shapes = std::ranges::count_if(
        column_effect_, [&](const ActiveEffect& other) { return other.effect == column_effect_[k].effect; });
    columns_[k].tolerance /= std::sqrt(static_cast<double>(shapes));
    columns_[k].discrepancy /= std::sqrt(static_cast<double>(shapes));
  }
}

void ColumnSet::scale_covariates(std::span<const double> shares) {
  std::size_t turn = 0;
  for (Hypothesis& h : hypotheses_) {
    if (!h.by) continue;
    const double share = shares[turn++ % shares.size()];
    Column& c = columns_[h.candidate.columns.front()];
    const double by_power = 1 / std::max(c.power_share, 1e-12);
    c.tolerance = unnoticed_outside * by_power;
    c.discrepancy = by_power;
    h.candidate.expected = share * by_power;
  }
}

void ColumnSet::scale_families(std::span<const double> shares) {
  const double kt = robot_.motor.torque_constant_nm_a * robot_.motor.gear_ratio;
  for (std::size_t f = 0; f < families_.size(); ++f) {
    double unit = mean_power_w_;  // coefficient that moves the mean power by all of it
    switch (families_[f].channel) {
      case Channel::torque_right:
        unit = mean_power_w_ / std::max(kt * torque_power_w_, 1e-9);
        break;
      case Channel::voltage_right:
        unit = mean_power_w_ / std::max(voltage_power_w_, 1e-9);
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
    for (std::size_t k = 0; k < families_[f].size; ++k) {
      Column& c = columns_[family_first_[f] + k];
      c.tolerance = unnoticed_outside * unit;
      c.discrepancy = unit;
      c.power_share = 1 / unit;
    }
    std::size_t turn = 0;
    for (Hypothesis& h : hypotheses_) {
      if (h.outside() && h.candidate.columns.front() == family_first_[f])
        h.candidate.expected = shares[turn++ % shares.size()] * unit;
    }
  }
}

}  // namespace joulecast::gap
