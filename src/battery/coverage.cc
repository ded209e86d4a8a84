#include "battery/coverage.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/try.h"
#include "battery/circuit.h"
#include "battery/discharge.h"

namespace joulecast::battery {
namespace {

// Of the resistances and lags of a lithium-ion cell [K]: conduction in the electrolyte has the least,
// transfer of charge at the electrodes the most. Assumed, not measured on this battery.
constexpr double least_activation_k = 1000, most_activation_k = 5000;
// Where robots work: a cold store or winter, and a hot hall.
constexpr std::array worked_at_c{0.0, 45.0};
constexpr double near_k = 5;          // a temperature this near to a tested one counts as covered
constexpr double higher_rate = 1.25;  // than any other test: a rate of its own

// The largest current that flowed for a share of the recording: single rows may be glitches.
double rate_of(const Recording& recording, double capacity_ah) {
  std::vector<double> current_a(recording.current_a.begin() + 1, recording.current_a.end());
  const auto at = static_cast<std::ptrdiff_t>(0.98 * static_cast<double>(current_a.size() - 1));
  std::ranges::nth_element(current_a, current_a.begin() + at);
  return current_a[static_cast<std::size_t>(at)] / capacity_ah;
}

const Recording* named(const std::vector<Recording>& recordings, const std::string& name) {
  const auto at = std::ranges::find(recordings, name, &Recording::name);
  return at == recordings.end() ? nullptr : &*at;
}

struct Test {
  const Recording* recording;
  double rate_1_h;
};

// Adds the conditions of one test.
void see(const Recording& recording, double capacity_ah, bool open_circuit, Coverage& seen) {
  for (const double t : recording.temperature_c) {
    if (!std::isfinite(t)) continue;
    if (!seen.temperature_c) seen.temperature_c = {t, t};
    seen.temperature_c->first = std::min(seen.temperature_c->first, t);
    seen.temperature_c->second = std::max(seen.temperature_c->second, t);
  }
  if (!open_circuit)
    seen.lowest_charge = std::clamp(1 - recording.charge_ah() / capacity_ah, 0.0, seen.lowest_charge);
}

Result<void> leave_out_fastest(const std::vector<Recording>& recordings, const std::vector<Test>& tests,
                               const robot::Battery& battery, const CalibrationOptions& options,
                               Coverage& seen) {
  const auto fastest = std::ranges::max_element(tests, {}, &Test::rate_1_h);
  double next = 0;
  std::vector<Recording> rest;
  std::vector<const Recording*> left_out;
  for (const Test& t : tests) {
    if (t.rate_1_h * higher_rate > fastest->rate_1_h) {
      left_out.push_back(t.recording);
    } else {
      next = std::max(next, t.rate_1_h);
    }
  }
  if (!(next > 0)) return {};
  for (const Recording& r : recordings)
    if (std::ranges::find(left_out, &r) == left_out.end()) rest.push_back(r);
  const auto without = calibrate(rest, options);
  if (!without) return {};  // the rest is not enough for a calibration, so that the rate's effect is unknown
  TRY_ASSIGN(const auto prediction,
             predict(Circuit(without->battery), *fastest->recording, Load::Kind::current));
  TRY_ASSIGN(const auto own, predict(Circuit(battery), *fastest->recording, Load::Kind::current));
  seen.fastest_left_out = {fastest->recording->name, fastest->rate_1_h, next,
                           prediction.time_error,    own.time_error,    prediction.voltage_rms_v,
                           own.voltage_rms_v};
  return {};
}

// Duration of a full discharge [s].
Result<double> lasts(const robot::Battery& battery, double rate_1_h, double temperature_c) {
  robot::Battery at = battery;
  // The temperature is prescribed, so that losses do not warm the battery.
  at.thermal_resistance_k_w.reset();
  at.thermal_time_constant_s.reset();
  const Circuit circuit(at);
  const double current_a = rate_1_h * circuit.capacity_ah();
  const Load load{Load::Kind::current, {{2 * 3600 / rate_1_h, current_a, current_a}}};
  DischargeLimits limits;
  limits.ambient_c = temperature_c;
  TRY_ASSIGN(const auto run, discharge(circuit, Circuit::rested(1, temperature_c), load, limits));
  return run.duration_s;
}

Result<void> try_temperatures(const robot::Battery& battery, Coverage& seen) {
  const auto [low, high] =
      seen.temperature_c.value_or(std::pair(reference_temperature_c, reference_temperature_c));
  const double middle_c = (low + high) / 2;
  for (const double temperature_c : worked_at_c) {
    if (temperature_c > low - near_k && temperature_c < high + near_k) continue;
    Coverage::Temperature unseen{temperature_c, std::min(1.0, seen.most_rate_1_h)};
    const auto share = [&](std::optional<double> activation_k) -> Result<double> {
      robot::Battery changed = battery;
      if (activation_k) changed.activation_k = *activation_k;
      TRY_ASSIGN(const double there, lasts(changed, unseen.rate_1_h, temperature_c));
      TRY_ASSIGN(const double here, lasts(changed, unseen.rate_1_h, middle_c));
      return there / here;
    };
    TRY_ASSIGN(unseen.by_this, share({}));
    TRY_ASSIGN(const double mild, share(least_activation_k));
    TRY_ASSIGN(const double strong, share(most_activation_k));
    unseen.least = std::min(mild, strong);
    unseen.most = std::max(mild, strong);
    seen.unseen_temperatures.push_back(unseen);
  }
  return {};
}

std::string of_rates(const Coverage& seen) {
  std::string text = fmt::format("rates above {:.2g} C were not tested", seen.most_rate_1_h);
  if (const auto& left = seen.fastest_left_out) {
    return text +
           fmt::format(
               "; expected error: predicted without {}, from rates up to {:.2g} C, the test at {:.2g} C has "
               "an error of {:+.1f} % in time and {:.0f} mV in voltage; with it {:+.1f} % and {:.0f} mV",
               left->name, left->seen_to_1_h, left->rate_1_h, 1e2 * left->time_error,
               1e3 * left->voltage_rms_v, 1e2 * left->own_time_error, 1e3 * left->own_voltage_rms_v);
  }
  return text +
         "; the error there is unknown, since no test can be predicted from slower ones. "
         "Add a test at another rate";
}

std::string of_temperature(const Coverage& seen, const Coverage::Temperature& t) {
  return fmt::format(
      "{:.0f} °C was not tested{}; there a discharge at {:.2g} C of usual lithium-ion cells lasts {:.0f} "
      "to {:.0f} % of its time at {}, and {:.0f} % by the model of this battery",
      t.temperature_c,
      seen.temperature_c ? fmt::format(" (tests: {:.0f} to {:.0f} °C)", seen.temperature_c->first,
                                       seen.temperature_c->second)
                         : " (no temperature was measured; 25 °C is assumed)",
      t.rate_1_h, 1e2 * t.least, 1e2 * t.most, seen.temperature_c ? "the tests' temperature" : "25 °C",
      1e2 * t.by_this);
}

}  // namespace

Result<Coverage> coverage(const std::vector<Recording>& recordings, const Calibration& calibration,
                          const CalibrationOptions& options) {
  const robot::Battery& battery = calibration.battery;
  const double capacity_ah = battery.capacity_ah * battery.ageing_factor.value_or(1);
  Coverage seen;
  std::vector<Test> tests;
  for (const RecordingFit& fit : calibration.recordings) {
    const Recording* recording = named(recordings, fit.name);
    if (recording == nullptr) continue;
    const double rate_1_h = rate_of(*recording, capacity_ah);
    see(*recording, capacity_ah, fit.open_circuit, seen);
    if (fit.open_circuit) {
      seen.slow_rate_1_h = rate_1_h;
      continue;
    }
    tests.push_back({recording, rate_1_h});
  }
  for (const Recording& r : recordings)
    seen.charging = seen.charging || *std::ranges::min_element(r.current_a) < -0.01 * capacity_ah;
  if (tests.empty()) return seen;
  seen.least_rate_1_h = std::ranges::min_element(tests, {}, &Test::rate_1_h)->rate_1_h;
  seen.most_rate_1_h = std::ranges::max_element(tests, {}, &Test::rate_1_h)->rate_1_h;
  TRY(leave_out_fastest(recordings, tests, battery, options, seen));
  TRY(try_temperatures(battery, seen));
  return seen;
}

std::vector<std::string> sentences(const Coverage& seen) {
  std::vector<std::string> all{of_rates(seen)};
  for (const Coverage::Temperature& t : seen.unseen_temperatures) all.push_back(of_temperature(seen, t));
  if (seen.lowest_charge > 0.05)
    all.push_back(fmt::format(
        "charges below {:.0f} % were not tested under load; the resistance is assumed "
        "constant there, but that of cells rises: the end of a discharge under load is less certain",
        1e2 * seen.lowest_charge));
  all.push_back(seen.charging
                    ? "charging was recorded and is not used; its losses are assumed to be those of "
                      "discharging, and its whole current to be stored"
                    : "charging was not tested; its losses are assumed to be those of discharging, and "
                      "its whole current to be stored");
  return all;
}

}  // namespace joulecast::battery
