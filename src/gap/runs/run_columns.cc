#include "gap/runs/run_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "gap/traits.h"
#include "signals/covariates.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

using dynamics::ActiveEffect;

// As in the diagnosis of recordings: a finding moves the energy by this share, and costs this log
// probability. Tables also hold models that are far off, hence the second scale.
constexpr std::array expected_shares{0.07, 0.3};
constexpr double run_effect_log_prior = -4.0;
constexpr double run_outside_log_prior = -6.0;
constexpr double unnoticed_run_share = 0.0025;
constexpr double max_run_tolerance_share = 0.02;
constexpr double too_small_share =
    0.002;  // of a run's energy within the bounds: nothing is said of such an effect
constexpr double common_scale = 0.01;        // of a calibrated model and of the meter that measured the runs
constexpr std::size_t max_label_levels = 8;  // of a label
// Of a run's energy over the model's against the usual ratio: a file that lacks most of the base load moves
// it by less, between runs that mostly stand and that mostly drive.
constexpr double far_off_ratio = 3;

// Which variants of an effect energies of runs can speak of: shapes that they cannot distinguish are left at
// their initial values.
std::vector<Cause> variants_of(const dynamics::Effect& effect, bool by_motor) {
  const std::string_view id = effect.info().id;
  std::vector<Cause> variants;
  const auto add = [&](std::size_t shape, double value, std::size_t parameter = 0) {
    Cause variant{dynamics::initial(effect), parameter, std::nullopt};
    if (shape > 0) variant.effect.values[shape] = value;
    variants.push_back(variant);
  };
  if (id == "friction_asymmetry" || id == "wheel_radius_asymmetry") {
    // Right against left is seen where the motors are measured singly.
    if (by_motor) add(0, 0);
    if (by_motor && id == "friction_asymmetry") add(1, 1);
  } else if (id == "torque_constant_loss") {
    add(1, 1);
    add(1, 0);
  } else if (id == "payload_mass_error") {
    add(0, 0);
    add(0, 0, 1);
  } else if (id == "current_sensor_gain" || id == "current_sensor_bias" || id == "voltage_sensor_gain") {
    add(1, by_motor ? 1 : 0);
    variants.back().effect.values[2] = by_motor ? 0 : 1;
  } else {
    add(0, 0);
  }
  return variants;
}

// Conditions that something unknown may follow.
struct Trend {
  std::string_view name;
  double (*value)(const MissionRun&, std::size_t place);
};
constexpr std::array<Trend, 7> trends{
    {{"payload", [](const MissionRun& r, std::size_t) { return r.at.payload_kg; }},
     {"speed", [](const MissionRun& r, std::size_t) { return r.at.speed_m_s; }},
     {"acceleration", [](const MissionRun& r, std::size_t) { return r.at.acceleration_m_s2; }},
     {"distance", [](const MissionRun& r, std::size_t) { return r.at.distance_m; }},
     {"turning", [](const MissionRun& r, std::size_t) { return std::fabs(r.at.turn_rad); }},
     {"standstill", [](const MissionRun& r, std::size_t) { return r.at.standstill_s; }},
     {"order", [](const MissionRun&, std::size_t place) { return static_cast<double>(place); }}}};

}  // namespace

RunColumns::RunColumns(const RunSet& set, const robot::RobotModel& robot, std::vector<ActiveEffect> adopted)
    : set_(set), robot_(robot), adopted_(std::move(adopted)), covariate_names_(set.covariates) {
  double given = 0, ours = 0;
  for (const MissionRun& run : runs()) {
    tables_.emplace(run.table, tables_.size());
    by_motor_ = by_motor_ && run.by_motor();
    model_given_ = model_given_ && !std::isnan(run.given_j());
    plain_.push_back(by_robot(plain_.size(), adopted_));
    covariates_.push_back(run.covariates);
    covariates_.back().resize(covariate_names_.size(), MissionRun::absent);
    if (std::isnan(run.given_j())) continue;
    given += run.given_j();
    ours += plain_.back().sum_j;
  }
  if (ours > 0) model_ratio_ = given / ours;
  set_sizes();
  add_labels();
  add_effects();
  add_covariates();
  first_relative_ = columns_.size();
  add_trends();
  add_shifts();
  linearise_around({});
}

void RunColumns::set_sizes() {
  std::vector<double> ratios;
  for (std::size_t k = 0; k < runs().size(); ++k)
    ratios.push_back(runs()[k].measured_j() / modelled(k, {}).sum_j);
  const double usual = statistics::median(ratios);
  for (std::size_t k = 0; k < runs().size(); ++k) {
    const bool far = std::fabs(std::log(ratios[k] / usual)) > std::log(far_off_ratio);
    size_j_.push_back(far ? usual * modelled(k, {}).sum_j : runs()[k].measured_j());
  }
}

// Each level of a label as a covariate that is 1 or 0, of two levels one.
void RunColumns::add_labels() {
  for (std::size_t l = 0; l < set_.labels.size(); ++l) {
    std::set<std::string> levels;
    for (const MissionRun& run : runs()) levels.insert(l < run.labels.size() ? run.labels[l] : "");
    levels.erase("");
    if (levels.size() < 2 || levels.size() > max_label_levels) continue;
    if (levels.size() == 2) levels.erase(levels.begin());
    for (const std::string& level : levels) {
      covariate_names_.push_back(set_.labels[l] + "=" + level);
      for (std::size_t k = 0; k < runs().size(); ++k) {
        const auto& own = runs()[k].labels;
        covariates_[k].push_back(l >= own.size() || own[l].empty() ? MissionRun::absent
                                 : own[l] == level                 ? 1
                                                                   : 0);
      }
    }
  }
  for (std::size_t c = 0; c < covariate_names_.size(); ++c) {
    std::vector<double> known;
    for (const auto& values : covariates_) {
      if (std::isfinite(values[c])) known.push_back(values[c]);
    }
    if (known.empty()) known.push_back(0);
    const double middle = statistics::median(known);
    const double centre = signals::is_label(covariate_names_[c]) ? middle : centre_of(std::move(known));
    for (auto& values : covariates_) values[c] = (std::isfinite(values[c]) ? values[c] : middle) - centre;
  }
}

std::vector<ActiveEffect> RunColumns::in_run(std::size_t run, std::span<const Cause> causes) const {
  std::vector<ActiveEffect> effects = adopted_;
  for (const Cause& cause : causes) {
    effects.push_back(cause.effect);
    if (cause.by) effects.back().values[cause.parameter] *= covariates_[run][cause.by->covariate];
  }
  return effects;
}

RunColumns::Energy RunColumns::by_robot(std::size_t run, std::span<const ActiveEffect> effects) const {
  const RunEnergy e = run_energy({robot_, effects}, runs()[run].at);
  if (!runs()[run].by_motor()) return {e.battery_j, 0, e.duration_s};
  return {e.motor_j[0] + e.motor_j[1], e.motor_j[0] - e.motor_j[1], e.duration_s};
}

RunColumns::Energy RunColumns::modelled(std::size_t k, std::span<const Cause> causes) const {
  const MissionRun& run = runs()[k];
  Energy e = causes.empty() ? plain_[k] : by_robot(k, in_run(k, causes));
  if (std::isnan(run.given_j())) return e;
  e.sum_j += run.given_j() - plain_[k].sum_j;
  if (run.by_motor()) e.difference_j += run.model_motor_j[0] - run.model_motor_j[1] - plain_[k].difference_j;
  return e;
}

double RunColumns::missed(std::size_t run, double energy_j) const {
  const double measured = runs()[run].measured_j();
  return std::fabs(measured - energy_j) / std::max(measured, size_j_[run]);
}

double RunColumns::error(std::span<const Cause> causes, const std::vector<bool>& left_out) const {
  double error = 0, count = 0;
  for (std::size_t k = 0; k < runs().size(); ++k) {
    if (!left_out.empty() && left_out[k]) continue;
    error += missed(k, modelled(k, causes).sum_j);
    ++count;
  }
  return error / count;
}

void RunColumns::add_effects() {
  std::set<std::string> seen, unseen;
  for (const dynamics::Effect* effect : dynamics::catalogue()) {
    const Traits& traits = traits_of(effect->info().id);
    const std::vector<Cause> variants = variants_of(*effect, by_motor_);
    if (variants.empty()) unseen.insert(std::string(effect->info().id));
    for (const Cause& variant : variants) {
      const dynamics::EffectParameter& info = effect->info().parameters[variant.parameter];
      double in_file = 0;
      for (const ActiveEffect& a : adopted_) in_file += a.effect == effect ? a.values[variant.parameter] : 0;
      // The largest change of any run within the bounds, by a step into the allowed side.
      const double bound = std::max(std::fabs(info.minimum), std::fabs(info.maximum));
      Cause moved = variant;
      const double step = moved.effect.values[variant.parameter] = (info.maximum > 0 ? 1 : -1) * 1e-3 * bound;
      double mean = 0, largest = 0;
      for (std::size_t k = 0; k < runs().size(); ++k) {
        const Energy e = by_robot(k, in_run(k, {&moved, 1}));
        const double share = std::hypot(e.sum_j - plain_[k].sum_j, e.difference_j - plain_[k].difference_j) /
                             size_j_[k] / std::fabs(step);
        mean += share / static_cast<double>(runs().size());
        largest = std::max(largest, share);
      }
      if (!(largest * bound > too_small_share)) {
        unseen.insert(std::string(effect->info().id));
        continue;
      }
      seen.insert(std::string(effect->info().id));
      Hypothesis h;
      h.effect = variant.effect;
      h.parameter = variant.parameter;
      h.one_shape = traits.one_shape;
      h.candidate.columns = {columns_.size()};
      h.candidate.least = (traits.nonnegative ? 0 : info.minimum) - in_file;
      h.candidate.most = info.maximum - in_file;
      if (effect->info().id == "accessory_load")
        h.candidate.least = std::max(h.candidate.least, -robot_.idle_power_w - in_file);
      h.candidate.log_prior =
          run_effect_log_prior - std::log(static_cast<double>(variants.size() * expected_shares.size()));
      Column c;
      c.power_share = mean;
      c.tolerance = unnoticed_run_share / mean;
      if (variant.parameter == 0 && traits.usual > 0)
        c.tolerance = std::min(traits.tolerance, max_run_tolerance_share / mean);
      c.discrepancy = 1 / mean;
      columns_.push_back(c);
      column_cause_.push_back(variant);
      for (const double share : expected_shares) {
        h.candidate.expected = std::min(share / mean, 0.5 * bound);
        hypotheses_.push_back(h);
      }
    }
  }
  for (const std::string& id : unseen) {
    if (!seen.contains(id)) not_visible_.push_back(id);
  }
}

// A covariate may be a load's or a friction's cause.
void RunColumns::add_covariates() {
  constexpr std::array<std::string_view, 2> carriers{"accessory_load", "coulomb_friction"};
  const std::vector<Hypothesis> effects = hypotheses_;
  for (std::size_t c = 0; c < covariate_names_.size(); ++c) {
    for (const std::string_view id : carriers) {
      const auto carrier = std::ranges::find_if(effects, [&](const Hypothesis& h) { return h.id() == id; });
      if (carrier == effects.end()) continue;
      const Cause cause{carrier->effect, carrier->parameter, Modulation{c, 0}};
      double mean = 0;
      for (std::size_t k = 0; k < runs().size(); ++k) {
        Cause one = cause;
        one.effect.values[one.parameter] = 1e-3 * carrier->candidate.expected;
        mean += std::fabs(by_robot(k, in_run(k, {&one, 1})).sum_j - plain_[k].sum_j) / size_j_[k] /
                (1e-3 * carrier->candidate.expected) / static_cast<double>(runs().size());
      }
      if (!(mean > 0)) continue;
      Hypothesis h;
      h.effect = carrier->effect;
      h.parameter = carrier->parameter;
      h.covariate = covariate_names_[c];
      h.by = cause.by;
      const std::string_view unit = h.effect.effect->info().parameters[h.parameter].unit;
      h.unit = signals::is_label(h.covariate) ? std::string(unit) : fmt::format("{}/unit", unit);
      h.candidate.log_prior =
          run_effect_log_prior - std::log(static_cast<double>(carriers.size() * expected_shares.size()));
      h.candidate.columns = {columns_.size()};
      columns_.push_back({unnoticed_run_share / mean, 0, 1 / mean, mean, 0});
      column_cause_.push_back(cause);
      for (const double share : expected_shares) {
        h.candidate.expected = share / mean;
        hypotheses_.push_back(h);
      }
    }
  }
}

void RunColumns::add_trends() {
  for (const Trend& trend : trends) {
    std::set<double> levels;
    for (std::size_t k = 0; k < runs().size(); ++k) levels.insert(trend.value(runs()[k], k));
    if (levels.size() < 2) continue;
    Hypothesis h;
    h.channel = "run_energy";
    h.variable = trend.name;
    h.candidate.log_prior = run_outside_log_prior - std::log(static_cast<double>(expected_shares.size()));
    // Several levels also allow a bend.
    for (std::size_t k = 0; k < (levels.size() > 2 ? 2u : 1u); ++k) {
      h.candidate.columns.push_back(columns_.size());
      columns_.push_back({unnoticed_run_share / 2, 0, 1, 1, 0});
    }
    for (const double share : expected_shares) {
      h.candidate.expected = share;
      hypotheses_.push_back(h);
    }
  }
}

void RunColumns::add_shifts() {
  first_shift_ = columns_.size() + 1;
  columns_.push_back({common_scale, 0, 0, 1, 0});
  if (tables_.size() > 1) columns_.resize(columns_.size() + tables_.size(), {0, 0, 0, 1, 0});
}

void RunColumns::linearise_around(std::span<const Cause> causes, const HypothesisSet& only) {
  const auto n = static_cast<Eigen::Index>(columns_.size());
  rows_.clear();
  for (std::size_t k = 0; k < runs().size(); ++k) {
    const MissionRun& run = runs()[k];
    const Energy model = modelled(k, causes);
    rows_.push_back({k, false, Eigen::VectorXd::Zero(n), run.measured_j() - model.sum_j});
    rows_.back().x[static_cast<Eigen::Index>(first_shift_ - 1)] = model.sum_j / size_j_[k];
    if (tables_.size() > 1)
      rows_.back().x[static_cast<Eigen::Index>(first_shift_ + tables_.at(run.table))] = 1;
    if (run.by_motor()) {
      rows_.push_back(
          {k, true, Eigen::VectorXd::Zero(n), run.motor_j[0] - run.motor_j[1] - model.difference_j});
      rows_.back().x[static_cast<Eigen::Index>(first_shift_ - 1)] = model.difference_j / size_j_[k];
    }
  }
  std::vector<bool> done(columns_.size(), false);
  for (std::size_t number = 0; number < hypotheses_.size(); ++number) {
    const Hypothesis& h = hypotheses_[number];
    // Hypotheses may share columns.
    const std::size_t first = h.candidate.columns.front();
    if (done[first] || (!only.empty() && std::ranges::find(only, number) == only.end())) continue;
    done[first] = true;
    if (!h.outside()) {
      differentiate(first, causes);
      continue;
    }
    const auto value = std::ranges::find(trends, h.variable, &Trend::name)->value;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t k = 0; k < runs().size(); ++k) {
      low = std::min(low, value(runs()[k], k));
      high = std::max(high, value(runs()[k], k));
    }
    for (RunRow& row : rows_) {
      if (row.difference) continue;
      const double u = 2 * (value(runs()[row.run], row.run) - low) / (high - low) - 1;
      row.x[static_cast<Eigen::Index>(first)] = u;
      if (h.candidate.columns.size() > 1) row.x[static_cast<Eigen::Index>(first + 1)] = 2 * u * u - 1;
    }
  }
}

// A centred difference, or towards the allowed side at a bound. What the strength of the linearisation point
// explains stays in the response.
void RunColumns::differentiate(std::size_t column, std::span<const Cause> causes) {
  const Cause& own = column_cause_[column];
  std::vector<Cause> base(causes.begin(), causes.end());
  auto found = std::ranges::find_if(base, [&](const Cause& c) {
    if (!c.same_kind(own)) return false;
    for (std::size_t p = 0; p < c.effect.values.size(); ++p) {
      if (p != own.parameter && std::fabs(c.effect.values[p] - own.effect.values[p]) > 1e-9) return false;
    }
    return c.parameter == own.parameter;
  });
  if (found == base.end()) found = base.insert(base.end(), own);
  double& value = found->effect.values[own.parameter];
  const auto h = std::ranges::find_if(
      hypotheses_, [&](const Hypothesis& o) { return o.candidate.columns.front() == column; });
  const double centre = value, step = 0.02 * h->candidate.expected;
  const double high = std::min(centre + step, h->candidate.most),
               low = std::max(centre - step, h->candidate.least);
  std::vector<Energy> above, below;
  value = high;
  for (std::size_t k = 0; k < runs().size(); ++k) above.push_back(by_robot(k, in_run(k, base)));
  value = low;
  for (std::size_t k = 0; k < runs().size(); ++k) below.push_back(by_robot(k, in_run(k, base)));
  for (RunRow& row : rows_) {
    const Energy &a = above[row.run], &b = below[row.run];
    const double change = row.difference ? a.difference_j - b.difference_j : a.sum_j - b.sum_j;
    const double slope = change / (high - low);
    row.x[static_cast<Eigen::Index>(column)] = slope;
    row.y += centre * slope;
  }
}

std::vector<Cause> RunColumns::causes_of(const HypothesisSet& set,
                                         const Eigen::VectorXd& coefficients) const {
  std::vector<Cause> causes;
  Eigen::Index at = 0;
  for (const std::size_t k : set) {
    const Hypothesis& h = hypotheses_[k];
    if (!h.outside()) {
      causes.push_back(h.cause());
      causes.back().effect.values[h.parameter] = coefficients[at];
    }
    at += static_cast<Eigen::Index>(h.candidate.columns.size());
  }
  return causes;
}

}  // namespace joulecast::gap
