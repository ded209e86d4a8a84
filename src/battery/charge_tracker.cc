#include "battery/charge_tracker.h"

#include <cmath>

#include "base/units.h"

namespace joulecast::battery {
namespace {

constexpr double update_s = 1;    // readings are averaged over this
constexpr double gap_s = 15;      // longer silences count as unknown current
constexpr double flat_sd = 0.15;  // of the charge from one voltage: from here on the curve counts as flat
constexpr double full_sd = 0.02;  // chargers end at different small currents

}  // namespace

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
