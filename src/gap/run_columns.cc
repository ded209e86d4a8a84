#include "gap/run_columns.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "gap/shapley.h"

namespace joulecast::gap {
namespace {

using dynamics::ActiveEffect;

// As in the diagnosis of recordings: a finding moves the energy by this share, and costs this log
// probability. Tables also hold models that are far off, hence the second scale.
constexpr std::array expected_shares{0.07, 0.3};
constexpr double effect_log_prior = -4.0;
constexpr double outside_log_prior = -6.0;
constexpr double unnoticed_share = 0.002;

// Which variants of an effect energies of runs can speak of: shapes that they cannot tell apart are left at
// their initial values.
std::vector<std::pair<ActiveEffect, std::size_t>> variants_of(const dynamics::Effect& effect, bool by_motor) {
  const std::string_view id = effect.info().id;
  const ActiveEffect plain = dynamics::initial(effect);
  std::vector<std::pair<ActiveEffect, std::size_t>> variants;
  const auto add = [&](std::size_t shape, double value, std::size_t parameter = 0) {
    ActiveEffect variant = plain;
    if (shape > 0) variant.values[shape] = value;
    variants.emplace_back(variant, parameter);
  };
  if (id == "friction_asymmetry" || id == "torque_constant_loss") {
    add(1, 1);
    add(1, 0);
  } else if (id == "payload_mass_error") {
    add(0, 0);
    add(0, 0, 1);
  } else if (id == "current_sensor_gain" || id == "current_sensor_bias" || id == "voltage_sensor_gain") {
    ActiveEffect variant = plain;
    variant.values[1] = by_motor ? 1 : 0;
    variant.values[2] = by_motor ? 0 : 1;
    variants.emplace_back(variant, 0);
  } else {
    add(0, 0);
  }
  return variants;
}

// Conditions that something unknown may follow.
struct Trend {
  std::string_view name;
  double (*value)(const MissionRun&);
};
constexpr std::array<Trend, 5> trends{
    {{"payload_kg", [](const MissionRun& r) { return r.at.payload_kg; }},
     {"speed_m_s", [](const MissionRun& r) { return r.at.speed_m_s; }},
     {"acceleration_m_s2", [](const MissionRun& r) { return r.at.acceleration_m_s2; }},
     {"distance_m", [](const MissionRun& r) { return r.at.distance_m; }},
     {"turn_rad", [](const MissionRun& r) { return std::fabs(r.at.turn_rad); }}}};

}  // namespace

RunColumns::RunColumns(std::span<const MissionRun> runs, const robot::RobotModel& robot)
    : runs_(runs.begin(), runs.end()),
      robot_(robot),
      adopted_(dynamics::active_effects(robot).value_or(std::vector<ActiveEffect>{})) {
  double given = 0, ours = 0;
  model_given_ = true;
  for (const MissionRun& run : runs_) {
    tables_.emplace(run.table, tables_.size());
    by_motor_ = by_motor_ && run.by_motor();
    const double model = run.by_motor() ? run.model_motor_j[0] + run.model_motor_j[1] : run.model_energy_j;
    model_given_ = model_given_ && !std::isnan(model);
    plain_.push_back(by_robot(plain_.size(), {}));
    if (std::isnan(model)) continue;
    given += model;
    ours += plain_.back().sum_j;
  }
  if (ours > 0) model_ratio_ = given / ours;
  add_effects();
  add_trends();
  linearise_around({});
}

RunColumns::Energy RunColumns::by_robot(std::size_t run, std::span<const ActiveEffect> effects) const {
  std::vector<ActiveEffect> all = adopted_;
  all.insert(all.end(), effects.begin(), effects.end());
  const RunEnergy energy = run_energy({robot_, all}, runs_[run].at);
  if (!runs_[run].by_motor()) return {energy.battery_j, 0};
  return {energy.motor_j[0] + energy.motor_j[1], energy.motor_j[0] - energy.motor_j[1]};
}

RunColumns::Energy RunColumns::modelled(std::size_t k, std::span<const ActiveEffect> effects) const {
  const MissionRun& run = runs_[k];
  Energy e = by_robot(k, effects);
  const double given = run.by_motor() ? run.model_motor_j[0] + run.model_motor_j[1] : run.model_energy_j;
  if (std::isnan(given)) return e;
  e.sum_j += given - plain_[k].sum_j;
  if (run.by_motor()) e.difference_j += run.model_motor_j[0] - run.model_motor_j[1] - plain_[k].difference_j;
  return e;
}

void RunColumns::add_effects() {
  std::set<std::string> seen, unseen;
  for (const dynamics::Effect* effect : dynamics::catalogue()) {
    const auto variants = variants_of(*effect, by_motor_);
    for (const auto& [variant, parameter] : variants) {
      const dynamics::EffectParameter& info = effect->info().parameters[parameter];
      // The largest change of any run within the bounds, by a step into the allowed side.
      const double bound = std::max(std::fabs(info.minimum), std::fabs(info.maximum));
      const double step = (info.maximum > 0 ? 1 : -1) * 1e-3 * bound;
      ActiveEffect moved = variant;
      moved.values[parameter] = step;
      double mean = 0, largest = 0;
      for (std::size_t k = 0; k < runs_.size(); ++k) {
        const Energy e = by_robot(k, {&moved, 1});
        const double share = std::hypot(e.sum_j - plain_[k].sum_j, e.difference_j - plain_[k].difference_j) /
                             runs_[k].measured_j() / std::fabs(step);
        mean += share / static_cast<double>(runs_.size());
        largest = std::max(largest, share);
      }
      if (!(largest * bound > unnoticed_share)) {
        unseen.insert(std::string(effect->info().id));
        continue;
      }
      seen.insert(std::string(effect->info().id));
      RunCandidate c;
      c.effect = variant;
      c.parameter = parameter;
      c.columns = {column_size_.size()};
      c.least = info.minimum;
      c.most = info.maximum;
      c.log_prior =
          effect_log_prior - std::log(static_cast<double>(variants.size() * expected_shares.size()));
      column_size_.push_back(0);
      for (const double share : expected_shares) {
        c.expected = std::min(share / mean, 0.5 * bound);
        candidates_.push_back(c);
      }
    }
  }
  for (const std::string& id : unseen) {
    if (!seen.contains(id)) not_visible_.push_back(id);
  }
}

void RunColumns::add_trends() {
  for (const Trend& trend : trends) {
    std::set<double> levels;
    for (const MissionRun& run : runs_) levels.insert(trend.value(run));
    if (levels.size() < 2) continue;
    RunCandidate c;
    c.variable = trend.name;
    c.columns = {column_size_.size()};
    c.least = -std::numeric_limits<double>::infinity();
    c.most = std::numeric_limits<double>::infinity();
    c.log_prior = outside_log_prior - std::log(static_cast<double>(expected_shares.size()));
    column_size_.push_back(0);
    // Several levels also allow a bend.
    if (levels.size() > 2) {
      c.columns.push_back(column_size_.size());
      column_size_.push_back(0);
    }
    for (const double share : expected_shares) {
      c.expected = share;
      candidates_.push_back(c);
    }
  }
}

void RunColumns::linearise_around(std::span<const ActiveEffect> effects, std::span<const std::size_t> only) {
  const auto n = static_cast<Eigen::Index>(column_size_.size());
  sum_.assign(runs_.size(), Eigen::VectorXd::Zero(n + 2));
  difference_.assign(runs_.size(), Eigen::VectorXd::Zero(n + 2));
  std::ranges::fill(column_size_, 0.0);
  for (std::size_t k = 0; k < runs_.size(); ++k) {
    const MissionRun& run = runs_[k];
    const double measured = run.measured_j();
    const Energy model = modelled(k, effects);
    const double measured_difference = run.by_motor() ? run.motor_j[0] - run.motor_j[1] : 0;
    sum_[k][n] = model.sum_j / measured;
    difference_[k][n] = model.difference_j / measured;
    sum_[k][n + 1] = (measured - model.sum_j) / measured;
    difference_[k][n + 1] = (measured_difference - model.difference_j) / measured;
  }
  const auto scaled = [](double value, double low, double high) {
    return 2 * (value - low) / (high - low) - 1;
  };
  std::vector<bool> done(column_size_.size(), false);
  for (std::size_t number = 0; number < candidates_.size(); ++number) {
    const RunCandidate& c = candidates_[number];
    // Candidates may share columns; with `only`, the others' stay empty.
    if (done[c.columns.front()] || (!only.empty() && std::ranges::find(only, number) == only.end())) continue;
    done[c.columns.front()] = true;
    const auto column = static_cast<Eigen::Index>(c.columns.front());
    if (c.outside()) {
      const auto value = std::ranges::find(trends, c.variable, &Trend::name)->value;
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (const MissionRun& run : runs_) {
        low = std::min(low, value(run));
        high = std::max(high, value(run));
      }
      for (std::size_t k = 0; k < runs_.size(); ++k) {
        const double u = scaled(value(runs_[k]), low, high);
        sum_[k][column] = u;
        if (c.columns.size() > 1) sum_[k][column + 1] = 2 * u * u - 1;
      }
    } else {
      // A centred difference, or towards the allowed side at a bound.
      std::vector<ActiveEffect> base(effects.begin(), effects.end());
      auto own = std::ranges::find_if(base, [&](const ActiveEffect& e) {
        if (e.effect != c.effect.effect) return false;
        for (std::size_t p = 0; p < e.values.size(); ++p) {
          if (p != c.parameter && std::fabs(e.values[p] - c.effect.values[p]) > 1e-9) return false;
        }
        return true;
      });
      if (own == base.end()) {
        base.push_back(c.effect);
        own = base.end() - 1;
      }
      double& value = own->values[c.parameter];
      const double centre = value, step = 0.02 * c.expected;
      const double high = std::min(centre + step, c.most), low = std::max(centre - step, c.least);
      for (std::size_t k = 0; k < runs_.size(); ++k) {
        value = high;
        const Energy above = by_robot(k, base);
        value = low;
        const Energy below = by_robot(k, base);
        const double scale = 1 / ((high - low) * runs_[k].measured_j());
        sum_[k][column] = (above.sum_j - below.sum_j) * scale;
        difference_[k][column] = (above.difference_j - below.difference_j) * scale;
        // What the strengths of the linearisation point explain stays in the response.
        sum_[k][n + 1] += centre * sum_[k][column];
        difference_[k][n + 1] += centre * difference_[k][column];
      }
      value = centre;
    }
    for (const std::size_t j : c.columns) {
      for (std::size_t k = 0; k < runs_.size(); ++k) {
        column_size_[j] +=
            std::hypot(sum_[k][static_cast<Eigen::Index>(j)], difference_[k][static_cast<Eigen::Index>(j)]) /
            static_cast<double>(runs_.size());
      }
    }
  }
}

std::vector<RunEquation> RunColumns::equations(std::size_t run) const {
  const std::size_t table = tables_.at(runs_[run].table);
  std::vector<RunEquation> equations{{table, false, sum_[run]}};
  if (runs_[run].by_motor()) equations.push_back({table, true, difference_[run]});
  return equations;
}

std::vector<ActiveEffect> RunColumns::effects_of(std::span<const std::size_t> set,
                                                 const Eigen::VectorXd& coefficients) const {
  std::vector<ActiveEffect> effects;
  Eigen::Index at = 0;
  for (const std::size_t c : set) {
    const RunCandidate& candidate = candidates_[c];
    if (!candidate.outside()) {
      ActiveEffect active = candidate.effect;
      active.values[candidate.parameter] = coefficients[at];
      effects.push_back(active);
    }
    at += static_cast<Eigen::Index>(candidate.columns.size());
  }
  return effects;
}

std::vector<double> RunColumns::effect_shares(std::span<const ActiveEffect> effects) const {
  return shapley_shares(effects.size(), [&](const std::vector<std::size_t>& members) {
    std::vector<ActiveEffect> some;
    for (const std::size_t k : members) some.push_back(effects[k]);
    double error = 0;
    for (std::size_t k = 0; k < runs_.size(); ++k) {
      const double measured = runs_[k].measured_j();
      error += std::fabs(measured - modelled(k, some).sum_j) / measured;
    }
    return error;
  });
}

}  // namespace joulecast::gap
