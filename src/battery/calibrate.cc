#include "battery/calibrate.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/median.h"
#include "base/try.h"
#include "battery/circuit.h"
#include "robot/robot_file.h"

namespace joulecast::battery {
namespace {

constexpr double slow_hours = 8;  // at least this long is an open-circuit test
constexpr double voltage_error_share = 0.00135;
constexpr double charge_error = 0.002;
constexpr double least_temperature_span_k = 3;
constexpr double flowing_share = 0.001;  // of the greatest current or the capacity in an hour: less is rest
constexpr double activation_unit_k = 1000;  // the fit's parameters are all of order one

// ---- the slow discharge ----

// Current above which the battery is in use: by the greatest current, and by the charge that it holds, as the
// zero of a current sensor is large relative to a slow discharge.
double flowing_a(const Recording& recording) {
  double charge_ah = 0, least_ah = 0, most_ah = 0;
  for (std::size_t row = 1; row < recording.size(); ++row) {
    charge_ah += recording.current_a[row] * recording.duration_s(row) / 3600;
    least_ah = std::min(least_ah, charge_ah), most_ah = std::max(most_ah, charge_ah);
  }
  return flowing_share * std::max(std::ranges::max(recording.current_a), most_ah - least_ah);
}

// The first interval without charging; a test that was recharged in the same file ends there.
Recording without_charging(const Recording& recording) {
  const double flowing = flowing_a(recording);
  const auto charges = [&](double current_a) { return current_a < -flowing; };
  const auto begin = std::find_if_not(recording.current_a.begin(), recording.current_a.end(), charges);
  const auto end = std::find_if(begin, recording.current_a.end(), charges);
  return recording.rows(begin - recording.current_a.begin(), end - recording.current_a.begin());
}

// Without the rest before and after, but for one row before.
Recording without_rests(const Recording& recording) {
  const double flowing = flowing_a(recording);
  auto first = recording.current_a.begin() + 1, last = recording.current_a.end();
  while (first + 1 < last && !(*first > flowing)) ++first;
  while (last > first + 1 && !(*(last - 1) > flowing)) --last;
  return recording.rows(first - recording.current_a.begin() - 1, last - recording.current_a.begin());
}

struct SlowTest {
  double capacity_ah = 0;
  double current_a = 0;
  double temperature_c = reference_temperature_c;
  double end_voltage_v = 0;
  std::vector<std::pair<double, double>> voltage;  // (charge, V), charge ascending
};

// Where the open-circuit curve has its points: finer where it is steep.
std::vector<double> charge_grid() {
  std::vector<double> grid;
  for (int i = 0; i < 20; ++i) grid.push_back(i * 0.005);
  for (int i = 10; i <= 100; ++i) grid.push_back(i * 0.01);
  return grid;
}

double mean_finite(const std::vector<double>& values, double otherwise) {
  double sum = 0;
  int count = 0;
  for (const double value : values)
    if (std::isfinite(value)) sum += value, ++count;
  return count > 0 ? sum / count : otherwise;
}

SlowTest slow_test(const Recording& recording) {
  SlowTest slow;
  slow.capacity_ah = recording.charge_ah();
  slow.current_a = slow.capacity_ah * 3600 / recording.duration_s();
  slow.temperature_c = mean_finite(recording.temperature_c, reference_temperature_c);
  slow.end_voltage_v = recording.voltage_v.back();
  double drawn_ah = 0;
  std::vector<std::pair<double, double>> descending{{1.0, recording.voltage_v.front()}};
  for (std::size_t row = 1; row < recording.size(); ++row) {
    drawn_ah += recording.current_a[row] * recording.duration_s(row) / 3600;
    const double charge = 1 - drawn_ah / slow.capacity_ah;
    if (charge < descending.back().first) descending.emplace_back(charge, recording.voltage_v[row]);
  }
  const Curve measured({descending.rbegin(), descending.rend()});
  for (const double charge : charge_grid()) slow.voltage.emplace_back(charge, measured.held(charge));
  return slow;
}

// The measured voltage plus the circuit's loss at the test's current, against the charge at the surface:
// follows the test from full to empty.
std::vector<std::pair<double, double>> open_circuit_voltage(const SlowTest& slow, robot::Battery battery) {
  battery.open_circuit_voltage = slow.voltage;
  const Circuit circuit(battery);
  State state = Circuit::rested(1, slow.temperature_c);
  std::vector<std::pair<double, double>> descending{slow.voltage.back()};
  for (std::size_t i = slow.voltage.size() - 1; i-- > 0;) {
    const double step = slow.voltage[i + 1].first - slow.voltage[i].first;
    state = circuit.advanced(state, slow.current_a, step * slow.capacity_ah * 3600 / slow.current_a,
                             slow.temperature_c);
    state.temperature_c = slow.temperature_c;
    const double surface = state.surface_charge();
    const double drop = circuit.open_circuit_voltage_v(surface) - circuit.voltage_v(state, slow.current_a);
    if (surface < descending.back().first) descending.emplace_back(surface, slow.voltage[i].second + drop);
  }
  const Curve at_surface({descending.rbegin(), descending.rend()});
  std::vector<std::pair<double, double>> curve = slow.voltage;
  for (auto& [charge, voltage] : curve) voltage = at_surface.extended(charge);
  for (std::size_t i = 1; i < curve.size(); ++i) {
    curve[i].second = std::max(curve[i].second, curve[i - 1].second);
  }
  return curve;
}

// ---- the model as a function of the fit's parameters ----

// Parameters: ln of the resistance at each knot, then ln of (share of that resistance, time constant) of the
// branch and of (lag, time constant) of each charge lag, then the activation over its unit.
struct Layout {
  std::vector<double> knots;  // charge
  bool with_activation = false;

  std::size_t share() const { return knots.size(); }
  std::size_t time_constant() const { return share() + 1; }
  std::size_t lag(std::size_t k) const { return share() + 2 + 2 * k; }
  std::size_t lag_time_constant(std::size_t k) const { return lag(k) + 1; }
  std::size_t activation() const { return share() + 6; }
  std::size_t size() const { return activation() + (with_activation ? 1 : 0); }

  // Of the battery, as a JSON pointer.
  std::string field(std::size_t at) const {
    if (at < share()) return fmt::format("/resistance_curve/{}/1", at);
    if (at < lag(0)) return at == share() ? "/branches/0/resistance_ohm" : "/branches/0/time_constant_s";
    if (at == activation()) return "/activation_k";
    const std::size_t k = (at - lag(0)) / 2;
    return fmt::format("/charge_lags/{}/{}", k, at == lag(k) ? "lag_s" : "time_constant_s");
  }
};

// Start and bounds of a fitted parameter.
struct Range {
  double first, low, high;
};
constexpr Range share_range = {0.3, 0.005, 20};
constexpr Range time_constant_range_s = {10, 1, 200};
constexpr Range lag_range_s = {70, 0.1, 2000};
constexpr Range lag_time_constant_range_s[2] = {{60, 5, 300}, {1500, 300, 10000}};
constexpr Range activation_range = {2, 0, 8};

robot::Battery battery_of(const Layout& layout, const double* p, const SlowTest& slow,
                          const robot::Battery& known) {
  robot::Battery battery = known;
  for (std::size_t i = 0; i < layout.knots.size(); ++i)
    battery.resistance_curve.emplace_back(layout.knots[i], std::exp(p[i]));
  battery.internal_resistance_ohm = Curve(battery.resistance_curve).held(0.5);
  battery.branches.push_back(
      {battery.internal_resistance_ohm * std::exp(p[layout.share()]), std::exp(p[layout.time_constant()])});
  for (std::size_t k = 0; k < 2; ++k)
    battery.charge_lags.push_back({std::exp(p[layout.lag(k)]), std::exp(p[layout.lag_time_constant(k)])});
  if (layout.with_activation) battery.activation_k = activation_unit_k * p[layout.activation()];
  battery.open_circuit_voltage = open_circuit_voltage(slow, battery);
  return battery;
}

// Voltage at each row, from the measured current and the last measured temperature; 25 °C before any was.
void simulate(const Circuit& circuit, const Recording& recording, std::vector<double>& voltage_v) {
  voltage_v.resize(recording.size());
  State state = Circuit::rested(1);
  double held_c = reference_temperature_c;
  for (std::size_t row = 0; row < recording.size(); ++row) {
    if (row > 0)
      state =
          circuit.advanced(state, recording.current_a[row], recording.duration_s(row), state.temperature_c);
    if (const double measured = recording.temperature_c[row]; std::isfinite(measured)) held_c = measured;
    state.temperature_c = held_c;
    voltage_v[row] = circuit.voltage_v(state, recording.current_a[row]);
  }
}

// ---- the fit ----

struct Target {
  const Recording* recording;
  std::vector<double> weight;  // 1/V of each row
};

// 1 / the error expected of each row: a share of the nominal voltage, and an error in charge along the curve.
std::vector<double> weights(const Recording& recording, double nominal_voltage_v, double capacity_ah) {
  std::vector<double> weight(recording.size());
  for (std::size_t row = 0; row < recording.size(); ++row) {
    double slope_v = 0;  // dV/dcharge at steady current
    if (row > 1 && recording.current_a[row] > flowing_share * capacity_ah &&
        std::abs(recording.current_a[row] - recording.current_a[row - 1]) < 0.01 * recording.current_a[row]) {
      const double step = recording.current_a[row] * recording.duration_s(row) / (3600 * capacity_ah);
      slope_v = (recording.voltage_v[row] - recording.voltage_v[row - 1]) / step;
    }
    weight[row] = 1 / std::hypot(voltage_error_share * nominal_voltage_v, charge_error * slope_v);
  }
  return weight;
}

// r with r²/2 turned into sqrt(1 + r²) - 1: single rows far off pull by their distance, not its square.
double softened(double r) {
  return std::copysign(std::sqrt(2 * (std::sqrt(1 + r * r) - 1)), r);
}

struct Residuals {
  const Layout& layout;
  const SlowTest& slow;
  const robot::Battery& known;
  const std::vector<Target>& targets;

  bool operator()(double const* const* parameters, double* residual) const {
    const Circuit circuit(battery_of(layout, parameters[0], slow, known));
    std::vector<double> voltage;
    for (const Target& target : targets) {
      simulate(circuit, *target.recording, voltage);
      for (std::size_t row = 0; row < voltage.size(); ++row)
        *residual++ = softened((voltage[row] - target.recording->voltage_v[row]) * target.weight[row]);
    }
    // A weak smoothness penalty on ln r determines knots that the tests barely constrain.
    for (std::size_t i = 1; i + 1 < layout.knots.size(); ++i) {
      const double* ln_r = parameters[0] + i;
      *residual++ = ln_r[-1] - 2 * ln_r[0] + ln_r[1];
    }
    return true;
  }
};

// The voltage step over the current step wherever the current jumps: an ohmic resistance to start from.
double first_resistance_ohm(const std::vector<Target>& targets, double capacity_ah) {
  std::vector<double> ratios;
  for (const Target& target : targets)
    for (std::size_t row = 1; row < target.recording->size(); ++row) {
      const double step_a = target.recording->current_a[row] - target.recording->current_a[row - 1];
      if (std::abs(step_a) > 0.1 * capacity_ah)
        ratios.push_back((target.recording->voltage_v[row - 1] - target.recording->voltage_v[row]) / step_a);
    }
  std::erase_if(ratios, [](double ratio) { return !(ratio > 0); });
  if (ratios.empty()) return 0.1 / capacity_ah;  // a tenth of a volt at 1 C
  return upper_median(std::move(ratios));
}

// From the lowest charge under load up, closer together towards empty.
std::vector<double> resistance_knots(const std::vector<Target>& targets, double capacity_ah) {
  double lowest = 1;
  for (const Target& target : targets)
    lowest = std::min(lowest, 1 - target.recording->charge_ah() / capacity_ah);
  lowest = std::clamp(lowest, 0.0, 0.8);
  std::vector<double> knots{lowest, lowest + 0.035, lowest + 0.085};
  for (const double knot : {0.25, 0.4, 0.6, 0.8, 1.0})
    if (knot > knots.back() + 0.03) knots.push_back(knot);
  return knots;
}

double temperature_span_k(const std::vector<Target>& targets) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Target& target : targets)
    for (const double temperature : target.recording->temperature_c)
      if (std::isfinite(temperature)) low = std::min(low, temperature), high = std::max(high, temperature);
  return high - low;
}

// ---- heat ----

struct Thermal {
  double resistance_k_w;
  double time_constant_s;
};

// For one time constant the temperature is linear in the thermal resistance, so that one is in closed form
// and the other searched on a grid of ratio 1.05.
std::optional<Thermal> thermal_fit(const std::vector<Target>& targets, const Curve& open_circuit_voltage_v,
                                   double capacity_ah) {
  Thermal best{0, 0};
  double least = std::numeric_limits<double>::infinity();
  for (double tau = 60; tau < 20000; tau *= 1.05) {
    double xx = 0, xy = 0, yy = 0;
    for (const Target& target : targets) {
      const Recording& recording = *target.recording;
      double filtered_w = 0, charge = 1;
      const auto known = std::find_if(recording.temperature_c.begin(), recording.temperature_c.end(),
                                      [](double t) { return std::isfinite(t); });
      if (known == recording.temperature_c.end()) continue;
      const double first_c = *known;
      for (std::size_t row = 1; row < recording.size(); ++row) {
        const double seconds = recording.duration_s(row);
        charge -= recording.current_a[row] * seconds / (3600 * capacity_ah);
        const double loss_w =
            recording.current_a[row] * (open_circuit_voltage_v.extended(charge) - recording.voltage_v[row]);
        filtered_w += -std::expm1(-seconds / tau) * (loss_w - filtered_w);
        const double rise_k = recording.temperature_c[row] - first_c;
        if (!std::isfinite(rise_k)) continue;
        xx += filtered_w * filtered_w;
        xy += filtered_w * rise_k;
        yy += rise_k * rise_k;
      }
    }
    if (!(xx > 0) || !(xy > 0)) continue;
    const double misfit = yy - xy * xy / xx;
    if (misfit < least) {
      least = misfit;
      best = {xy / xx, tau};
    }
  }
  if (!std::isfinite(least)) return std::nullopt;
  return best;
}

// ---- the use of each recording ----

// The parts of the recordings before they charge; those without discharge are passed over.
Result<std::vector<Recording>> discharges(const std::vector<Recording>& given, Calibration& out) {
  std::vector<Recording> recordings;
  for (const Recording& recording : given) {
    Recording part = without_charging(recording);
    if (part.size() >= 2 && part.charge_ah() > 0) {
      recordings.push_back(std::move(part));
      continue;
    }
    if (recording.charge_ah() < 0 && recording.voltage_v.back() < recording.voltage_v.front())
      return invalid(
          "recordings",
          recording.name +
              " charges while its voltage falls; current must be positive while the battery discharges");
    out.passed_over.push_back({recording.name, "draws no charge"});
  }
  return recordings;
}

// The longest full discharge without pause, its rests cut off.
Result<const Recording*> slowest_of(std::vector<Recording>& recordings) {
  const Recording* slowest = nullptr;
  for (Recording& recording : recordings) {
    const Recording core = without_rests(recording);
    if (core.duration_s() <= slow_hours * 3600 ||
        !(*std::min_element(core.current_a.begin() + 1, core.current_a.end()) > 0) ||
        (slowest != nullptr && core.duration_s() <= slowest->duration_s()))
      continue;
    recording = core;
    slowest = &recording;
  }
  if (slowest != nullptr) return slowest;
  std::string seen;
  for (const Recording& recording : recordings)
    seen += fmt::format("{}{} ({:.1f} h, {:.2f} Ah)", seen.empty() ? "" : ", ", recording.name,
                        recording.duration_s() / 3600, recording.charge_ah());
  return invalid("recordings", fmt::format("need a full discharge without pause over more than {} h for the "
                                           "open-circuit voltage; none of these is one: {}",
                                           slow_hours, seen));
}

// Recordings that are fitted: every other recording that draws a share of the charge.
Result<std::vector<Target>> targets_of(const std::vector<Recording>& recordings, const Recording& slowest,
                                       const SlowTest& slow, double nominal_voltage_v, Calibration& out) {
  std::vector<Target> targets;
  for (const Recording& recording : recordings) {
    if (&recording == &slowest) continue;
    if (const double charge_ah = recording.charge_ah();
        !(charge_ah > 0.1 * slow.capacity_ah && charge_ah <= 1.2 * slow.capacity_ah)) {
      out.passed_over.push_back(
          {recording.name,
           fmt::format("draws {:.3f} Ah, must be between 0.1 and 1.2 times the {:.3f} Ah of {}", charge_ah,
                       slow.capacity_ah, slowest.name)});
      continue;
    }
    targets.push_back({&recording, weights(recording, nominal_voltage_v, slow.capacity_ah)});
  }
  if (!targets.empty()) return targets;
  std::string unused;
  for (const PassedOver& p : out.passed_over)
    unused += fmt::format("{} {} {}", unused.empty() ? ";" : ",", p.name, p.reason);
  return invalid("recordings", "need a constant-current or pulse discharge besides the slow one" + unused);
}

struct StepsTold : ceres::IterationCallback {
  explicit StepsTold(const std::function<void(int)>& told) : on_step(told) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& step) override {
    on_step(step.iteration);
    return ceres::SOLVER_CONTINUE;
  }
  const std::function<void(int)>& on_step;
};

// The battery of least misfit, its parameters within their ranges.
Result<void> fit(const Layout& layout, const SlowTest& slow, const robot::Battery& known,
                 const std::vector<Target>& targets, const std::function<void(int)>& on_step,
                 Calibration& out) {
  std::vector<double> p(layout.size());
  std::size_t rows = layout.knots.size() - 2;
  for (const Target& target : targets) rows += target.recording->size();
  ceres::Problem problem;
  auto* cost = new ceres::DynamicNumericDiffCostFunction<Residuals, ceres::CENTRAL>(
      new Residuals{layout, slow, known, targets});
  cost->AddParameterBlock(static_cast<int>(layout.size()));
  cost->SetNumResiduals(static_cast<int>(rows));
  problem.AddResidualBlock(cost, nullptr, p.data());
  const auto bound = [&](std::size_t i, double first, double low, double high) {
    p[i] = first;
    problem.SetParameterLowerBound(p.data(), static_cast<int>(i), low);
    problem.SetParameterUpperBound(p.data(), static_cast<int>(i), high);
  };
  const auto bound_ln = [&](std::size_t i, const Range& range) {
    bound(i, std::log(range.first), std::log(range.low), std::log(range.high));
  };
  const double resistance_ohm = first_resistance_ohm(targets, slow.capacity_ah);
  for (std::size_t i = 0; i < layout.knots.size(); ++i)
    bound_ln(i, {resistance_ohm, resistance_ohm / 50, resistance_ohm * 50});
  bound_ln(layout.share(), share_range);
  bound_ln(layout.time_constant(), time_constant_range_s);
  for (std::size_t k = 0; k < 2; ++k) {
    bound_ln(layout.lag(k), lag_range_s);
    bound_ln(layout.lag_time_constant(k), lag_time_constant_range_s[k]);
  }
  if (layout.with_activation)
    bound(layout.activation(), activation_range.first, activation_range.low, activation_range.high);
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_QR;
  solver.max_num_iterations = 60;
  solver.function_tolerance = 1e-5;
  solver.logging_type = ceres::SILENT;
  StepsTold steps(on_step);
  if (on_step) solver.callbacks.push_back(&steps);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (!summary.IsSolutionUsable())
    return fail(Fault::infeasible, "recordings", "the fit found no parameters: " + summary.message);
  out.iterations = static_cast<int>(summary.iterations.size());
  out.battery = battery_of(layout, p.data(), slow, known);
  const auto written = robot::battery_to_json(out.battery);
  for (std::size_t i = 0; i < p.size(); ++i) {
    const auto at = static_cast<int>(i);
    if (p[i] > problem.GetParameterLowerBound(p.data(), at) &&
        p[i] < problem.GetParameterUpperBound(p.data(), at))
      continue;
    const std::string field = layout.field(i);
    out.at_bounds.push_back({field, written.at(nlohmann::json::json_pointer(field)).get<double>()});
  }
  return {};
}

// How far the fitted battery's voltage is from each recording that was used, in the order given.
void tell_misfits(const Recording& slowest, const std::vector<Target>& targets, Calibration& out) {
  const Circuit circuit(out.battery);
  std::vector<double> voltage;
  std::vector<const Recording*> used{&slowest};
  for (const Target& target : targets) used.push_back(target.recording);
  std::ranges::sort(used);
  for (const Recording* recording : used) {
    simulate(circuit, *recording, voltage);
    double sum = 0;
    for (std::size_t row = 0; row < voltage.size(); ++row)
      sum += std::pow(voltage[row] - recording->voltage_v[row], 2);
    out.recordings.push_back(
        {recording->name, recording == &slowest, std::sqrt(sum / static_cast<double>(voltage.size()))});
  }
}

}  // namespace

Result<Calibration> calibrate(const std::vector<Recording>& given, const CalibrationOptions& options) {
  Calibration out;
  TRY_ASSIGN(auto recordings, discharges(given, out));
  TRY_ASSIGN(const auto slowest, slowest_of(recordings));
  const SlowTest slow = slow_test(*slowest);
  robot::Battery known;
  known.nominal_voltage_v = Curve(slow.voltage).mean();
  TRY_ASSIGN(const auto targets, targets_of(recordings, *slowest, slow, known.nominal_voltage_v, out));

  known.capacity_ah = options.rated_capacity_ah.value_or(slow.capacity_ah);
  if (options.rated_capacity_ah) known.ageing_factor = slow.capacity_ah / *options.rated_capacity_ah;
  known.reserve_fraction = options.reserve_fraction;
  known.cutoff_voltage_v = std::round(slow.end_voltage_v * 1000) / 1000;

  const Layout layout{resistance_knots(targets, slow.capacity_ah),
                      temperature_span_k(targets) >= least_temperature_span_k};
  TRY(fit(layout, slow, known, targets, options.on_step, out));
  if (layout.with_activation) {
    if (const auto thermal =
            thermal_fit(targets, Curve(out.battery.open_circuit_voltage), slow.capacity_ah)) {
      out.battery.thermal_resistance_k_w = thermal->resistance_k_w;
      out.battery.thermal_time_constant_s = thermal->time_constant_s;
    }
  }
  tell_misfits(*slowest, targets, out);
  return out;
}

}  // namespace joulecast::battery
