#include "battery/prediction.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/try.h"
#include "statistics/robust.h"

namespace joulecast::battery {
namespace {

bool same_current(const Recording& recording, std::size_t row) {
  return std::abs(recording.current_a[row] - recording.current_a[row - 1]) <=
         1e-3 * std::abs(recording.current_a[row]);
}

// Over the rows before the discharge has drawn all but least_charge of `full_ah`.
double rms_above_least_charge(const Recording& recording, const std::vector<double>& predicted_v,
                              double full_ah) {
  double drawn_ah = 0, sum = 0;
  std::size_t rows = 0;
  for (std::size_t row = 0; row < std::min(recording.size(), predicted_v.size()); ++row) {
    if (row > 0) drawn_ah += recording.current_a[row] * recording.duration_s(row) / 3600;
    if (drawn_ah >= (1 - least_charge) * full_ah) break;
    sum += std::pow(predicted_v[row] - recording.voltage_v[row], 2);
    ++rows;
  }
  return std::sqrt(sum / static_cast<double>(rows));
}

// Until the recorded voltage is first down at `end_voltage_v`, which it reaches; straight between rows of the
// same current.
double time_to_s(const Recording& recording, double end_voltage_v) {
  std::size_t row = 0;
  while (row + 1 < recording.size() && recording.voltage_v[row] > end_voltage_v) ++row;
  const double at_s = recording.time_s[row] - recording.time_s.front();
  if (row == 0) return at_s;
  const double above_v = recording.voltage_v[row - 1] - end_voltage_v,
               fall_v = recording.voltage_v[row - 1] - recording.voltage_v[row];
  if (!same_current(recording, row) || !(fall_v > 0)) return at_s;
  return at_s - recording.duration_s(row) * (1 - above_v / fall_v);
}

// The recording as a load. Power runs straight between rows of the same current and is held elsewhere.
Result<Load> recorded_load(const Recording& recording, Load::Kind kind) {
  if (kind == Load::Kind::current) return held_load(kind, recording.time_s, recording.current_a);
  std::vector<double> power(recording.size());
  for (std::size_t row = 0; row < recording.size(); ++row)
    power[row] = recording.current_a[row] * recording.voltage_v[row];
  TRY_ASSIGN(auto load, held_load(kind, recording.time_s, power));
  for (std::size_t row = 1; row < recording.size(); ++row)
    if (same_current(recording, row)) load.pieces[row - 1].begin = power[row - 1];
  return load;
}

}  // namespace

Result<Prediction> predict(const Circuit& circuit, const Recording& recording, Load::Kind from) {
  if (!(recording.charge_ah() > 0)) return invalid(recording.name, "draws no charge");
  TRY_ASSIGN(const auto recorded, recorded_load(recording, from));
  const auto known = std::find_if(recording.temperature_c.begin(), recording.temperature_c.end(),
                                  [](double t) { return std::isfinite(t); });
  const double ambient_c = known != recording.temperature_c.end() ? *known : reference_temperature_c;
  const State start = Circuit::rested(1, ambient_c);

  Prediction out;
  out.name = recording.name;
  out.end_voltage_v = std::max(circuit.cutoff_voltage_v(), recording.voltage_v.back());
  out.measured_s = time_to_s(recording, out.end_voltage_v);
  Load continued = recorded;
  const double last = continued.pieces.back().end;
  continued.pieces.push_back({recording.duration_s(), last, last});
  TRY_ASSIGN(const auto to_end, discharge(circuit, start, continued, {out.end_voltage_v, ambient_c}));
  if (to_end.ending == Ending::load_ended)
    return fail(Fault::infeasible, recording.name,
                fmt::format("still at {:.3f} V after twice the recorded time; the recording ends at {:.3f} V",
                            to_end.voltage_v, out.end_voltage_v));
  out.predicted_s = to_end.duration_s;
  out.time_error = out.predicted_s / out.measured_s - 1;

  // Voltages go on below the end voltage, so that a discharge predicted too short is compared in full.
  TRY_ASSIGN(const auto through, discharge(circuit, start, recorded, {0.0, ambient_c}));
  std::vector<double> terminal_v{circuit.inner_voltage_v(start)};
  terminal_v.insert(terminal_v.end(), through.terminal_v.begin(), through.terminal_v.end());
  out.voltage_rms_v = rms_above_least_charge(recording, terminal_v, recording.charge_ah());
  out.voltage_rms_by_capacity_v = rms_above_least_charge(recording, terminal_v, circuit.capacity_ah());
  return out;
}

PredictionSummary summarise(const std::vector<Prediction>& predictions) {
  PredictionSummary out;
  out.count = predictions.size();
  if (predictions.empty()) return out;
  std::vector<double> errors;
  double sum = 0, sum_by_capacity = 0;
  for (const Prediction& prediction : predictions) {
    errors.push_back(std::abs(prediction.time_error));
    sum += std::pow(prediction.voltage_rms_v, 2);
    sum_by_capacity += std::pow(prediction.voltage_rms_by_capacity_v, 2);
    out.voltage_rms_worst_v = std::max(out.voltage_rms_worst_v, prediction.voltage_rms_v);
  }
  out.time_error_median = statistics::quantile(errors, 0.5);
  out.time_error_p95 = statistics::quantile(errors, 0.95);
  const auto count = static_cast<double>(predictions.size());
  out.voltage_rms_v = std::sqrt(sum / count);
  out.voltage_rms_by_capacity_v = std::sqrt(sum_by_capacity / count);
  return out;
}

}  // namespace joulecast::battery
