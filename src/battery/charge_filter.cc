#include "battery/charge_filter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/median.h"
#include "base/units.h"

namespace joulecast::battery {
namespace {

enum : Eigen::Index {
  at_charge,
  at_branch,
  at_lag = at_branch + 2,
  at_bias = at_lag + 2,
  at_factor,
  at_error
};

using Vector = ChargeFilter::Vector;
using Matrix = ChargeFilter::Matrix;

constexpr double bias_memory_s = 6 * 3600;         // over which the sensor's offset drifts
constexpr double resistance_memory_s = 12 * 3600;  // over which the resistance drifts, with temperature
constexpr double contradiction_sd = 3;
constexpr double strained_sd = 3;
constexpr int contradictions_to_restart = 5;
constexpr int most_iterations = 6;
constexpr double shift_updates = 3600;  // over which readings on a displaced curve count as one
constexpr double first_spread =
    0.05;  // of charge, over which the first line is drawn while the charge is unknown

// Gauss-Hermite, five points, for a standard normal variable.
constexpr std::array<double, 5> nodes{-2.856970013872806, -1.355626179974266, 0, 1.355626179974266,
                                      2.856970013872806};
constexpr std::array<double, 5> node_weights{0.011257411327721, 0.222075922005613, 0.533333333333333,
                                             0.222075922005613, 0.011257411327721};

State state_of(const Vector& x, double temperature_c) {
  return {x[at_charge], {x[at_branch], x[at_branch + 1]}, {x[at_lag], x[at_lag + 1]}, temperature_c};
}

// Sets one state's variance and removes its correlation with the others.
void isolate(Matrix& p, Eigen::Index k, double variance) {
  p.row(k).setZero();
  p.col(k).setZero();
  p(k, k) = variance;
}

constexpr double update_s = 1;    // readings are averaged over this
constexpr double gap_s = 15;      // longer silences count as unknown current
constexpr double flat_sd = 0.15;  // of the charge from one voltage: from here on the curve counts as flat
constexpr double full_sd = 0.02;  // chargers end at different small currents

}  // namespace

ChargeFilter::ChargeFilter(const robot::Battery& battery)
    : circuit_(battery),
      nominal_voltage_v_(battery.nominal_voltage_v),
      curve_sd_v_(battery.nominal_voltage_v *
                  (battery.open_circuit_voltage.empty() ? trust_.default_curve_sd : trust_.open_circuit_sd)),
      shift_sd_(battery.open_circuit_voltage.empty() ? trust_.default_shift_sd : trust_.curve_shift_sd),
      shift_stays_(battery.open_circuit_voltage.empty()),
      resistance_sd_(battery.resistance_curve.empty() && battery.branches.empty()
                         ? trust_.default_resistance_sd
                         : trust_.resistance_sd),
      bias_sd_a_(trust_.bias_per_h * circuit_.capacity_ah()) {
  forget();
}

void ChargeFilter::forget() {
  x_.setZero();
  p_.setZero();
  x_[at_charge] = 0.5;
  const auto spread = [&](Eigen::Index k, double sd) { p_(k, k) = sd * sd; };
  spread(at_charge, trust_.unknown_charge_sd);
  spread(at_bias, bias_sd_a_);
  spread(at_factor, resistance_sd_);
  spread(at_error, curve_sd_v_);
  begin(0);
  known_ = false;
  contradictions_ = 0;
}

void ChargeFilter::observe_charge(double value, double sd) {
  const Vector gain = p_.col(at_charge) / (p_(at_charge, at_charge) + sd * sd);
  x_ += gain * (value - x_[at_charge]);
  const Matrix taken = gain * p_.row(at_charge);
  p_ -= taken;
  p_ = (0.5 * (p_ + p_.transpose())).eval();
  known_ = true;
}

void ChargeFilter::advance(double current_a, double duration_s, double current_sd_a) {
  if (!(duration_s > 0)) return;
  const double true_a = current_a - x_[at_bias];
  const State before = state();
  const State after = circuit_.advanced(before, true_a, duration_s, temperature_c_);
  // All moves are linear in state and current; differences of one ampere give the derivatives exactly but for
  // the coulombic efficiency, which changes where the current turns.
  const State one = circuit_.advanced(before, true_a + 1, duration_s, temperature_c_);
  const State kept = circuit_.advanced({0, {1, 1}, {1, 1}, temperature_c_}, 0, duration_s, temperature_c_);

  Matrix f = Matrix::Identity();
  Vector by_current = Vector::Zero();
  by_current[at_charge] = one.charge - after.charge;
  for (Eigen::Index k = 0; k < 2; ++k) {
    const auto b = static_cast<std::size_t>(k);
    f(at_branch + k, at_branch + k) = kept.branch_current_a[b];
    f(at_lag + k, at_lag + k) = kept.charge_lag[b];
    by_current[at_branch + k] = one.branch_current_a[b] - after.branch_current_a[b];
    by_current[at_lag + k] = one.charge_lag[b] - after.charge_lag[b];
  }
  const double moved = std::abs(after.charge - before.charge);
  const double keep_bias = std::exp(-duration_s / bias_memory_s);
  const double keep_factor = std::exp(-duration_s / resistance_memory_s);
  const double keep_error = std::exp(-moved / trust_.correlation_charge - duration_s / trust_.correlation_s);
  f.col(at_bias) = -by_current;
  f(at_bias, at_bias) = keep_bias;
  f(at_factor, at_factor) = keep_factor;
  f(at_error, at_error) = keep_error;

  x_[at_charge] = std::clamp(after.charge, -0.05, 1.05);
  for (Eigen::Index k = 0; k < 2; ++k) {
    const auto b = static_cast<std::size_t>(k);
    x_[at_branch + k] = after.branch_current_a[b];
    x_[at_lag + k] = after.charge_lag[b];
  }
  x_[at_bias] *= keep_bias;
  x_[at_factor] *= keep_factor;
  x_[at_error] *= keep_error;
  p_ = (f * p_ * f.transpose()).eval();
  const auto wander = [&](Eigen::Index k, double sd, double keep) {
    p_(k, k) += sd * sd * (1 - keep * keep);
  };
  wander(at_bias, bias_sd_a_, keep_bias);
  wander(at_factor, resistance_sd_, keep_factor);
  wander(at_error, curve_sd_v_, keep_error);
  p_(at_charge, at_charge) += trust_.gain_sd * trust_.gain_sd * trust_.correlation_charge * moved;
  if (current_sd_a > 0) {
    const double blocks = std::max(1.0, trust_.modelled_current_s / duration_s);
    p_ += current_sd_a * current_sd_a * blocks * by_current * by_current.transpose();
  }
}

State ChargeFilter::state() const {
  return state_of(x_, temperature_c_);
}

double ChargeFilter::drop_v(const State& at, double current_a, double factor) const {
  double ohmic = circuit_.ohmic_resistance_ohm(at) * current_a;
  for (std::size_t k = 0; k < 2; ++k) ohmic += circuit_.branch_resistance_ohm(k, at) * at.branch_current_a[k];
  return factor * ohmic;
}

ChargeFilter::Linear ChargeFilter::linearise(const Vector& x, const Matrix& p, double current_a) const {
  Vector surface = Vector::Zero();
  surface[at_charge] = 1;
  surface[at_lag] = surface[at_lag + 1] = -1;
  const double spread = std::sqrt(std::max(1e-12, surface.dot(p * surface)));
  const double true_a = current_a - x[at_bias];
  const double factor = std::exp(x[at_factor]);
  const State at = state_of(x, temperature_c_);

  std::array<double, nodes.size()> volts{};
  double mean_v = 0, slope = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    State there = at;
    there.charge += spread * nodes[k];
    volts[k] = circuit_.open_circuit_voltage_v(there.surface_charge()) - drop_v(there, true_a, factor);
    mean_v += node_weights[k] * volts[k];
    slope += node_weights[k] * nodes[k] * volts[k] / spread;
  }
  double variance = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k)
    variance += node_weights[k] * std::pow(volts[k] - mean_v - slope * spread * nodes[k], 2);

  Vector h = slope * surface;
  for (Eigen::Index k = 0; k < 2; ++k)
    h[at_branch + k] = -factor * circuit_.branch_resistance_ohm(static_cast<std::size_t>(k), at);
  h[at_bias] = factor * circuit_.ohmic_resistance_ohm(at);
  h[at_factor] = -drop_v(at, true_a, factor);
  h[at_error] = 1;
  return {mean_v + x[at_error], h, variance};
}

// Where along the curve the voltage would be met by the rest of the state.
double ChargeFilter::charge_at(double voltage_v, double current_a) const {
  constexpr int steps = 100;
  double best = x_[at_charge], least = std::numeric_limits<double>::infinity();
  for (int k = 0; k <= steps; ++k) {
    State there = state();
    there.charge = static_cast<double>(k) / steps;
    const double expected = circuit_.open_circuit_voltage_v(there.surface_charge()) -
                            drop_v(there, current_a - x_[at_bias], std::exp(x_[at_factor]));
    if (std::abs(expected - voltage_v) < least) {
      least = std::abs(expected - voltage_v);
      best = there.charge;
    }
  }
  return best;
}

// The current before the first reading is unknown; it was probably similar to the first one.
void ChargeFilter::begin(double current_a) {
  const double sd_a = 0.5 * std::abs(current_a) + trust_.unknown_current_per_h * circuit_.capacity_ah();
  const State mean = circuit_.advanced({}, 0.5 * current_a, seconds_per_hour, temperature_c_);
  const State spread = circuit_.advanced({}, sd_a, seconds_per_hour, temperature_c_);
  for (Eigen::Index k = 0; k < 2; ++k) {
    const auto b = static_cast<std::size_t>(k);
    x_[at_branch + k] = mean.branch_current_a[b];
    x_[at_lag + k] = mean.charge_lag[b];
    isolate(p_, at_branch + k, std::pow(spread.branch_current_a[b], 2));
    isolate(p_, at_lag + k, std::pow(spread.charge_lag[b], 2));
  }
}

// Whether the first readings of a displaced curve, which count as one, have another voltage without current
// than the estimate began with; it then begins again with their median, as voltage at this current.
bool ChargeFilter::revises_first(double& voltage_v, double current_a) {
  constexpr std::size_t first_readings = 60;
  if (!shift_stays_ || first_v_.size() >= first_readings) return false;
  const double drop = drop_v(state(), current_a, 1);
  first_v_.push_back(voltage_v + drop);
  if (!known_) {
    begun_v_ = first_v_.back();
    return false;
  }
  const double middle_v = upper_median(first_v_);
  if (!(std::abs(middle_v - begun_v_) > curve_sd_v_)) return false;
  begun_v_ = middle_v;
  voltage_v = begun_v_ - drop;
  return true;
}

void ChargeFilter::correct(double voltage_v, double current_a, double more_noise_v) {
  if (revises_first(voltage_v, current_a)) {
    std::vector<double> first = std::move(first_v_);
    forget();
    first_v_ = std::move(first);
  }
  if (!known_) begin(current_a);
  const Vector x0 = x_;
  const Matrix p0 = p_;
  const double noise_v = std::hypot(trust_.voltage_noise * nominal_voltage_v_, more_noise_v,
                                    trust_.drop_sd * drop_v(state(), current_a - x0[at_bias], 1));
  // A displaced curve is displaced in every reading: all of them contain no more information than the first.
  const bool repeated = shift_stays_ && known_;
  if (!known_) {
    // The first line is drawn where the voltage points to.
    x_[at_charge] = charge_at(voltage_v, current_a);
    isolate(p_, at_charge, first_spread * first_spread);
  }
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    const Linear linear = linearise(x_, p_, current_a);
    const Vector& h = linear.h;
    // The line through the expansion point, applied to the prior.
    const double expected = linear.mean_v + h.dot(x0 - x_);
    const Vector ph = p0 * h;
    const double shift_v = shift_sd_ * (repeated ? std::sqrt(shift_updates) : 1) * h[at_charge];
    const double innovation_variance = h.dot(ph) + linear.variance_v2 + noise_v * noise_v + shift_v * shift_v;
    const double innovation = voltage_v - expected;
    if (iteration == 0 && known_) {
      double surprise = innovation / std::sqrt(innovation_variance);
      // A charge far off the voltage's, on a steep piece of the curve, hides in the curve's error.
      if (std::abs(x_[at_error]) > strained_sd * curve_sd_v_)
        surprise = std::copysign(contradiction_sd, x_[at_error]);
      if (std::abs(surprise) < contradiction_sd) {
        contradictions_ = 0;
      } else {
        const int way = surprise > 0 ? 1 : -1;
        contradictions_ = contradictions_ * way > 0 ? contradictions_ + way : way;
      }
      if (std::abs(contradictions_) >= contradictions_to_restart) {
        const double offset_a = x_[at_bias], offset_variance = p_(at_bias, at_bias);
        forget();
        x_[at_bias] = offset_a;
        p_(at_bias, at_bias) = offset_variance;
        ++restarts_;
        return correct(voltage_v, current_a, more_noise_v);
      }
      // A single contradiction may be a glitch: wait for more.
      if (contradictions_ != 0) return;
    }
    const double before = x_[at_charge], sd = std::sqrt(p_(at_charge, at_charge));
    const Vector gain = ph / innovation_variance;
    x_ = x0 + gain * innovation;
    p_ = p0 - gain * ph.transpose();
    p_ = (0.5 * (p_ + p_.transpose())).eval();
    if (iteration > 0 && std::abs(x_[at_charge] - before) < 0.02 * sd &&
        std::abs(std::sqrt(p_(at_charge, at_charge)) - sd) < 0.02 * sd)
      break;
  }
  x_[at_charge] = std::clamp(x_[at_charge], -0.05, 1.05);
  known_ = true;
}

void ChargeFilter::gap(double duration_s) {
  const double current_sd_a = trust_.unknown_current_per_h * circuit_.capacity_ah();
  const State after = circuit_.advanced({0, {1, 1}, {1, 1}, temperature_c_}, 0, duration_s, temperature_c_);
  const State driven = circuit_.advanced({}, current_sd_a, duration_s, temperature_c_);
  const auto relax = [&](Eigen::Index at, double keep, double variance) {
    x_[at] *= keep;
    p_.row(at) *= keep;
    p_.col(at) *= keep;
    p_(at, at) += variance;
  };
  for (Eigen::Index k = 0; k < 2; ++k) {
    const auto b = static_cast<std::size_t>(k);
    relax(at_branch + k, after.branch_current_a[b], std::pow(driven.branch_current_a[b], 2));
    relax(at_lag + k, after.charge_lag[b], std::pow(driven.charge_lag[b], 2));
  }
  const double lost = trust_.unknown_current_per_h * duration_s / seconds_per_hour;
  const double most = trust_.unknown_charge_sd * trust_.unknown_charge_sd;
  p_(at_charge, at_charge) =
      std::max(p_(at_charge, at_charge), std::min(most, p_(at_charge, at_charge) + lost * lost));
  // The other states drift as in advance(), without its charge.
  const auto wander = [&](Eigen::Index k, double sd, double memory_s) {
    const double keep = std::exp(-duration_s / memory_s);
    relax(k, keep, sd * sd * (1 - keep * keep));
  };
  wander(at_bias, bias_sd_a_, bias_memory_s);
  wander(at_factor, resistance_sd_, resistance_memory_s);
  wander(at_error, curve_sd_v_, trust_.correlation_s);
}

double ChargeFilter::charge() const {
  return std::clamp(x_[at_charge], 0.0, 1.0);
}

double ChargeFilter::charge_sd() const {
  return std::sqrt(p_(at_charge, at_charge));
}

double ChargeFilter::current_bias_a() const {
  return x_[at_bias];
}

double ChargeFilter::current_bias_sd_a() const {
  return std::sqrt(p_(at_bias, at_bias));
}

double ChargeFilter::voltage_only_sd() const {
  Matrix wide = p_;
  // Over a tenth of the capacity: single points of a measured curve are noisy.
  isolate(wide, at_charge, 0.05 * 0.05);
  const Linear linear = linearise(x_, wide, 0);
  return std::hypot(curve_sd_v_, trust_.voltage_noise * nominal_voltage_v_) /
         std::max(linear.h[at_charge], 1e-9);
}

bool ChargeFilter::recall(const Memory& memory) {
  const Matrix& p = memory.covariance;
  if (!memory.mean.allFinite() || !p.allFinite() || !(p.diagonal().minCoeff() >= 0) ||
      !(p(at_charge, at_charge) > 0))
    return false;
  x_ = memory.mean;
  p_ = p;
  known_ = memory.known;
  contradictions_ = 0;
  // The first readings are not stored.
  first_v_.clear();
  begun_v_ = known_ ? std::numeric_limits<double>::quiet_NaN() : 0;
  return true;
}

std::string_view name(ChargeSource source) {
  constexpr std::string_view names[] = {"unknown", "voltage_and_current", "voltage_and_model", "current",
                                        "model"};
  return names[static_cast<std::size_t>(source)];
}

std::string limitation_of(const ChargeEstimate& estimate) {
  if (estimate.source == ChargeSource::unknown) return {};
  if (estimate.default_curve)
    return "The robot file has no battery.open_circuit_voltage: a typical curve is used.";
  return estimate.flat_curve ? "The battery's voltage barely depends on the charge here: it is counted from "
                               "the current."
                             : "";
}

ChargeTracker::ChargeTracker(const robot::Battery& battery, double idle_power_w)
    : filter_(battery), idle_power_w_(idle_power_w), default_curve_(battery.open_circuit_voltage.empty()) {
  refresh();
}

void ChargeTracker::add(const ChargeReading& reading) {
  if (!last_) {
    // Nothing was measured between a remembered time and the first reading.
    if (counted_utime_us_ != 0 && reading.utime_us > counted_utime_us_)
      filter_.gap(static_cast<double>(reading.utime_us - counted_utime_us_) * seconds_per_microsecond);
    last_ = reading;
    counted_utime_us_ = reading.utime_us;
    duration_s_ = charge_as_ = modelled_as_ = voltage_vs_ = voltage_s_ = 0;
    if (!filter_.known() && std::isfinite(reading.voltage_v) && std::isfinite(reading.current_a)) {
      filter_.correct(reading.voltage_v, reading.current_a);
      source_ = ChargeSource::voltage_and_current;
    }
    refresh();
    return;
  }
  const double interval_s = static_cast<double>(reading.utime_us - last_->utime_us) * seconds_per_microsecond;
  if (!(interval_s > 0)) return;
  if (interval_s > gap_s) {
    update();
    filter_.gap(interval_s);
    refresh();
    counted_utime_us_ = reading.utime_us;
    last_ = reading;
    return;
  }
  double current_a = 0.5 * (last_->current_a + reading.current_a);
  const double voltage_v = 0.5 * (last_->voltage_v + reading.voltage_v);
  if (std::isfinite(voltage_v)) {
    voltage_vs_ += voltage_v * interval_s;
    voltage_s_ += interval_s;
  }
  if (!std::isfinite(current_a)) {
    const double power_w = std::isfinite(reading.modelled_power_w) ? reading.modelled_power_w : idle_power_w_;
    const double at_v =
        std::isfinite(voltage_v) ? voltage_v : filter_.circuit().open_circuit_voltage_v(filter_.charge());
    current_a = power_w / at_v;
    modelled_as_ += std::abs(current_a) * interval_s;
  }
  charge_as_ += current_a * interval_s;
  duration_s_ += interval_s;
  last_ = reading;
  if (duration_s_ >= update_s) update();
}

void ChargeTracker::update() {
  if (!(duration_s_ > 0)) return;
  const double current_a = charge_as_ / duration_s_;
  const double current_sd_a = ChargeTrust().modelled_current_sd * modelled_as_ / duration_s_;
  filter_.advance(current_a, duration_s_, current_sd_a);
  const bool voltage = voltage_s_ >= 0.5 * duration_s_;
  if (voltage) {
    const double noise_v =
        current_sd_a * filter_.circuit().ohmic_resistance_ohm(Circuit::rested(filter_.charge()));
    filter_.correct(voltage_vs_ / voltage_s_, current_a, noise_v);
  }
  const bool modelled = modelled_as_ > 0;
  if (filter_.known())
    source_ = voltage ? (modelled ? ChargeSource::voltage_and_model : ChargeSource::voltage_and_current)
                      : (modelled ? ChargeSource::model : ChargeSource::current);
  counted_utime_us_ = last_->utime_us;
  duration_s_ = charge_as_ = modelled_as_ = voltage_vs_ = voltage_s_ = 0;
  refresh();
}

void ChargeTracker::observe_full() {
  filter_.observe_charge(1, full_sd);
  refresh();
}

void ChargeTracker::refresh() {
  ChargeEstimate& out = estimate_;
  out = {};
  out.default_curve = default_curve_;
  if (!filter_.known()) return;
  out.charge = filter_.charge();
  out.sd = filter_.charge_sd();
  out.source = source_;
  out.flat_curve = filter_.voltage_only_sd() > flat_sd;
  out.current_bias_a = filter_.current_bias_a();
  out.current_bias_sd_a = filter_.current_bias_sd_a();
}

std::optional<ChargeTracker::Memory> ChargeTracker::memory() const {
  if (counted_utime_us_ == 0) return std::nullopt;
  return Memory{filter_.memory(), counted_utime_us_};
}

bool ChargeTracker::recall(const Memory& memory) {
  if (memory.utime_us <= 0 || !filter_.recall(memory.filter)) return false;
  counted_utime_us_ = memory.utime_us;
  // Until the next reading the charge is the remembered one.
  source_ = memory.filter.known ? ChargeSource::current : ChargeSource::unknown;
  refresh();
  return true;
}

}  // namespace joulecast::battery
