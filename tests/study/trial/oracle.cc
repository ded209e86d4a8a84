#include "tests/study/trial/oracle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "dynamics/catalogue.h"
#include "tests/study/trial/window_power.h"
#include "windows/windows.h"

namespace joulecast::trial {
namespace {

constexpr std::size_t most_effects = 2;
constexpr int reweightings = 12;
constexpr double relative_step = 1e-3;  // of the strength, for the slope of power by strength

// Residual power and its slopes, at the true parameters.
struct Row {
  std::size_t mission = 0;
  double residual_w = 0;  // measured - modelled at the true strengths
  std::array<double, most_effects> slope_w{};
};

std::optional<dynamics::ActiveEffect> true_effect(const robot::AdoptedEffect& sealed) {
  const dynamics::Effect* effect = dynamics::find_effect(sealed.id);
  if (effect == nullptr) return std::nullopt;
  dynamics::ActiveEffect active = dynamics::initial(*effect);
  const auto& info = effect->info().parameters;
  for (const auto& [name, value] : sealed.parameters) {
    for (std::size_t k = 0; k < info.size(); ++k) {
      if (info[k].name == name || (k == 0 && name == "strength")) active.values[k] = value;
    }
  }
  return active;
}

using Coefficients = std::array<double, most_effects>;

// Least absolute deviations of residual = slope . x over the rows of all missions but one, by reweighted
// least squares.
Coefficients fit_without(const std::vector<Row>& rows, std::size_t left_out) {
  double typical = 0;
  for (const Row& row : rows) typical += std::fabs(row.residual_w);
  typical /= static_cast<double>(rows.size());
  Coefficients x{};
  for (int k = 0; k < reweightings; ++k) {
    double a00 = 1e-12, a01 = 0, a11 = 1e-12, b0 = 0, b1 = 0;
    for (const Row& row : rows) {
      if (row.mission == left_out) continue;
      const auto [s0, s1] = row.slope_w;
      const double left = row.residual_w - s0 * x[0] - s1 * x[1];
      const double weight = 1 / std::max(std::fabs(left), 0.05 * typical);
      a00 += weight * s0 * s0;
      a01 += weight * s0 * s1;
      a11 += weight * s1 * s1;
      b0 += weight * s0 * row.residual_w;
      b1 += weight * s1 * row.residual_w;
    }
    const double determinant = a00 * a11 - a01 * a01;
    if (!(determinant > 1e-9 * a00 * a11)) {  // one effect, or two that power cannot distinguish
      x = a00 > a11 ? Coefficients{b0 / a00, 0} : Coefficients{0, b1 / a11};
    } else {
      x = {(b0 * a11 - b1 * a01) / determinant, (b1 * a00 - b0 * a01) / determinant};
    }
  }
  return x;
}

}  // namespace

std::optional<double> oracle_shrinkage(const telemetry::RecordingSet& recordings,
                                       const robot::RobotModel& robot, const SealedTruth& truth) {
  if (recordings.missions.size() < 2) return std::nullopt;
  std::vector<dynamics::ActiveEffect> effects;
  windows::WindowSettings settings;
  for (const robot::AdoptedEffect& sealed : truth.effects) {
    const auto active = true_effect(sealed);
    if (!active) return std::nullopt;
    // A delay is taken out of the recording, not out of the power.
    if (sealed.id == "sensor_delay") settings.electrical_delay_s = active->values[0];
    effects.push_back(*active);
  }
  if (effects.empty() || effects.size() > most_effects) return std::nullopt;

  const windows::Readings readings = windows::find_readings(recordings.missions);
  const auto plain = windows::make_windows(recordings.missions, robot, readings);
  const auto nominal = window_powers_w(robot, {}, plain);
  double before = 0;
  for (std::size_t k = 0; k < plain.size(); ++k) {
    const double e = plain[k].battery_power_w - nominal[k];
    if (std::isfinite(e)) before += std::fabs(e);
  }

  const auto windows = windows::make_windows(recordings.missions, robot, readings, settings);
  const auto modelled = window_powers_w(robot, effects, windows);
  std::vector<std::vector<double>> moved;
  for (std::size_t k = 0; k < effects.size(); ++k) {
    auto stepped = effects;
    stepped[k].values[0] *= 1 + relative_step;
    moved.push_back(window_powers_w(robot, stepped, windows));
  }
  std::vector<Row> rows;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    Row row{windows[w].mission, windows[w].battery_power_w - modelled[w], {}};
    bool finite = std::isfinite(row.residual_w);
    for (std::size_t k = 0; k < effects.size(); ++k) {
      row.slope_w[k] = (moved[k][w] - modelled[w]) / relative_step;
      finite = finite && std::isfinite(row.slope_w[k]);
    }
    if (finite) rows.push_back(row);
  }
  if (rows.empty() || !(before > 0)) return std::nullopt;
  double after = 0;
  for (std::size_t m = 0; m < recordings.missions.size(); ++m) {
    const Coefficients x = fit_without(rows, m);
    for (const Row& row : rows) {
      if (row.mission == m) {
        after += std::fabs(row.residual_w - row.slope_w[0] * x[0] - row.slope_w[1] * x[1]);
      }
    }
  }
  return 1 - after / before;
}

}  // namespace joulecast::trial
