#include "battery/discharge.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "base/try.h"
#include "energy/integrators.h"
#include "statistics/robust.h"

namespace joulecast::battery {
namespace {

// State as CVODE carries it: first its numbers in their order.
using Numbers = std::array<double, sizeof(State) / sizeof(double)>;
enum : std::size_t { drawn_at = std::tuple_size_v<Numbers>, energy_at, size };

enum : std::size_t { voltage_event, power_event, event_count };

constexpr Ending endings[event_count] = {Ending::voltage, Ending::power};

class Problem final : public energy::InitialValueProblem {
 public:
  Problem(const Circuit& circuit, const DischargeLimits& limits, Load::Kind kind)
      : circuit_(circuit),
        kind_(kind),
        voltage_limit_v_(limits.voltage_v.value_or(circuit.cutoff_voltage_v())),
        ambient_c_(limits.ambient_c) {}

  void set_piece(const Load::Piece& piece, double began_s) {
    piece_ = piece;
    began_s_ = began_s;
  }

  static State unpacked(std::span<const double> y) {
    Numbers numbers;
    std::ranges::copy(y.first<numbers.size()>(), numbers.begin());
    return std::bit_cast<State>(numbers);
  }

  double asked(double t) const {
    return piece_.begin + (piece_.end - piece_.begin) * ((t - began_s_) / piece_.duration_s);
  }

  // Beyond the battery's greatest power, CVODE may still probe on its way to the root: the current of
  // greatest power is used there.
  double current_a(double t, const State& state) const {
    if (kind_ == Load::Kind::current) return asked(t);
    if (const auto current = circuit_.current_at_power_a(state, asked(t))) return *current;
    return std::max(0.0, circuit_.inner_voltage_v(state)) / (2 * circuit_.ohmic_resistance_ohm(state));
  }

  void rate(double t, std::span<const double> y, std::span<double> out) override {
    const State state = unpacked(y);
    const double current = current_a(t, state);
    std::ranges::copy(std::bit_cast<Numbers>(circuit_.rate(state, current, ambient_c_)), out.begin());
    out[drawn_at] = current / 3600;
    out[energy_at] = current * circuit_.voltage_v(state, current);
  }

  // Relative 1e-7 with floors far below the accuracy of these quantities.
  void weights(std::span<const double> y, std::span<double> weight) const override {
    static constexpr std::array floors{1e-8, 1e-6, 1e-6, 1e-8, 1e-8, 1e-4, 1e-7, 1e-3};
    static_assert(floors.size() == size);
    for (std::size_t i = 0; i < size; ++i) weight[i] = 1 / (1e-7 * std::abs(y[i]) + floors[i]);
  }

  std::size_t event_count() const override { return battery::event_count; }

  void events(double t, std::span<const double> y, std::span<double> value) const override {
    const State state = unpacked(y);
    value[voltage_event] = circuit_.voltage_v(state, current_a(t, state)) - voltage_limit_v_;
    value[power_event] = 1;
    if (kind_ == Load::Kind::power) {
      const double most = circuit_.most_power_w(state);
      value[power_event] = std::isinf(most) ? 1 : most - asked(t);
    }
  }

  // An event that holds already, as after a jump of the load, which no sign change would show.
  std::optional<std::size_t> event_at(double t, std::span<const double> y) const {
    double values[battery::event_count];
    events(t, y, values);
    // Insufficient power takes precedence over the voltage.
    for (const std::size_t event : {power_event, voltage_event})
      if (values[event] < 0) return event;
    return std::nullopt;
  }

 private:
  const Circuit& circuit_;
  Load::Kind kind_;
  double voltage_limit_v_;
  double ambient_c_;
  Load::Piece piece_{1, 0, 0};
  double began_s_ = 0;
};

Result<void> check(std::span<const double> time_s, std::span<const double> value) {
  if (time_s.size() != value.size())
    return invalid(
        "value", fmt::format("has {} numbers, must have as many as time_s, {}", value.size(), time_s.size()));
  if (time_s.size() < 2) return invalid("time_s", fmt::format("has {} numbers, must have 2", time_s.size()));
  for (std::size_t i = 0; i < time_s.size(); ++i) {
    if (!std::isfinite(value[i])) return invalid("value", fmt::format("is not finite at {}", i));
    if (!std::isfinite(time_s[i])) return invalid("time_s", fmt::format("is not finite at {}", i));
    if (i > 0 && !(time_s[i] > time_s[i - 1]))
      return invalid("time_s", fmt::format("is {} s at {}, must be after the one before, {} s", time_s[i], i,
                                           time_s[i - 1]));
  }
  return {};
}

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

Result<Discharge> discharge(const Circuit& circuit, const State& start, const Load& load,
                            const DischargeLimits& limits) {
  const auto numbers = std::bit_cast<Numbers>(start);
  if (!std::ranges::all_of(numbers, [](double v) { return std::isfinite(v); }))
    return invalid("start", "has a number that is not finite");
  Problem problem(circuit, limits, load.kind);
  energy::Cvode cvode(size, problem);
  const std::span<double> y = cvode.state();
  std::fill(y.begin(), y.end(), 0.0);
  std::ranges::copy(numbers, y.begin());

  Discharge out;
  out.voltage_v = circuit.inner_voltage_v(start);
  double now_s = 0;
  std::optional<std::size_t> event;
  for (const Load::Piece& piece : load.pieces) {
    problem.set_piece(piece, now_s);
    event = problem.event_at(now_s, y);
    const bool at_once = event.has_value();
    if (!at_once) {
      TRY_ASSIGN(const auto arrival, cvode.advance(now_s, now_s + piece.duration_s));
      now_s = arrival.time_s;
      event = arrival.event;
    }
    const State state = Problem::unpacked(y);
    out.voltage_v = circuit.voltage_v(state, problem.current_a(now_s, state));
    if (!at_once) {
      out.time_s.push_back(now_s);
      out.terminal_v.push_back(out.voltage_v);
    }
    if (event) break;
  }
  out.duration_s = now_s;
  if (event) out.ending = endings[*event];
  out.state = Problem::unpacked(y);
  out.charge_ah = y[drawn_at];
  out.energy_j = y[energy_at];
  return out;
}

Result<Load> held_load(Load::Kind kind, std::span<const double> time_s, std::span<const double> value) {
  TRY(check(time_s, value));
  Load load{kind, {}};
  for (std::size_t i = 1; i < time_s.size(); ++i)
    load.pieces.push_back({time_s[i] - time_s[i - 1], value[i], value[i]});
  return load;
}

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
