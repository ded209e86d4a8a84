#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "gap/posterior/hold_out.h"
#include "gap/posterior/terms.h"
#include "gap/runs/run_rows.h"
#include "gap/verdict/words.h"
#include "statistics/regression.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t most_told = 5;  // outliers one by one
constexpr double gross = 6;           // spreads of the regression, beyond which a run is an outlier

struct Energies {
  std::vector<double> measured, modelled;
};

Energies energies_of(const RunRows& rows) {
  Energies e;
  for (const MissionRun& run : rows.runs()) e.measured.push_back(run.measured_j());
  e.modelled = rows.modelled_j();
  return e;
}

// Wh and kJ differ by a factor of 3.6, and files that lack a base load are off by as much. The energy per
// metre separates them: loads are no part of it.
std::optional<Check> other_unit(const RunRows& rows, const std::string& column) {
  constexpr double off = 4;     // most of a run's ratio from either unit
  constexpr double near = 1.5;  // of the energy per metre
  constexpr std::array<std::pair<const char*, double>, 2> units{{{"Wh", 3600}, {"kJ", 1000}}};
  const Energies e = energies_of(rows);
  for (std::size_t k = 0; k < e.measured.size(); ++k) {
    const double smaller = e.modelled[k] / e.measured[k];
    if (smaller > off * units[0].second || smaller < units[1].second / off) return std::nullopt;
  }
  const posterior::Data& d = rows.data();
  const Eigen::MatrixXd x = posterior::term_columns(d).x;
  const auto per_m = [&](const Eigen::VectorXd& power) {
    return statistics::robust_regression(x, power, d.rows.blocks()).coefficients[1];
  };
  const Eigen::VectorXd measured = d.rows.measured_w();
  const double smaller = per_m(posterior::predicted_power(d, d.in_file)) / per_m(measured);
  std::string unit = "Wh or kJ";
  for (const auto& [name, in_j] : units)
    if (smaller < near * in_j && smaller > in_j / near) unit = name;
  std::vector<double> ratio;
  for (std::size_t k = 0; k < e.measured.size(); ++k) ratio.push_back(e.measured[k] / e.modelled[k]);
  const double usual = statistics::median(std::move(ratio));
  return Check{"energy_unit",
               column,
               usual,
               {windows::missing, windows::missing},
               fmt::format("{} looks given in {}: every run's is about 1/{:.0f} of what the model takes. "
                           "joulecast expects J (1 Wh is 3600 J, 1 kJ is 1000 J).",
                           column, unit, 1 / usual),
               true};
}

std::optional<Check> constant(const RunRows& rows, const std::string& column) {
  constexpr double same = 1e-6, differs = 1.2;
  const auto [measured, modelled] = energies_of(rows);
  const auto [least, most] = std::ranges::minmax(measured);
  const auto [low, high] = std::ranges::minmax(modelled);
  if (most > (1 + same) * least || high < differs * low) return std::nullopt;
  return Check{"constant_channel",
               column,
               most,
               {windows::missing, windows::missing},
               fmt::format("{} is {} J in all {} runs, where the model has {} to {} J: a constant, no "
                           "measurement.",
                           column, brief(most), measured.size(), brief(low), brief(high)),
               true};
}

RunChecks outliers(const RunRows& rows, const std::string& column) {
  constexpr std::size_t fewest = 10;  // runs, of which a spread can be estimated
  RunChecks found;
  if (rows.runs().size() < fewest) return found;
  const auto [usual, apart] = rows.regression();
  std::vector<std::size_t>& far = found.apart;
  for (std::size_t k = 0; k < apart.size(); ++k)
    if (std::fabs(apart[k]) > gross) far.push_back(k);
  // A deviation of a tenth or more of the runs is systematic.
  if (10 * far.size() >= apart.size()) return {};
  std::ranges::sort(far, {}, [&, &by = apart](std::size_t k) { return -std::fabs(by[k]); });
  for (std::size_t n = 0; n < std::min(far.size(), most_told); ++n) {
    const std::size_t k = far[n];
    found.checks.push_back(
        {"run_apart",
         column,
         apart[k],
         {windows::missing, windows::missing},
         fmt::format("Run {} took {} J; from the others about {} J are expected: a wrong value, or "
                     "another event. Its weight is small.",
                     rows.runs()[k].name, brief(rows.runs()[k].measured_j()),
                     brief(std::max(0.0, usual[k])))});
  }
  return found;
}

std::optional<Check> overload(const RunRows& rows, double limit_kg) {
  const auto& run =
      *std::ranges::max_element(rows.runs(), {}, [](const MissionRun& r) { return r.at.payload_kg; });
  if (!(limit_kg > 0 && run.at.payload_kg > limit_kg)) return std::nullopt;
  return Check{"payload_over_limit",
               "payload_kg",
               run.at.payload_kg / limit_kg,
               {windows::missing, windows::missing},
               fmt::format("payload_kg of run {} is {}, above the file's limits.payload_kg, {}.", run.name,
                           brief(run.at.payload_kg), brief(limit_kg))};
}

}  // namespace

RunChecks check_runs(const RunRows& rows, const robot::RobotModel& robot) {
  const std::string column = rows.by_motor() ? "right_j, left_j" : "energy_j";
  for (const auto check : {other_unit, constant})
    if (auto found = check(rows, column)) return {{std::move(*found)}, {}};
  RunChecks found = outliers(rows, column);
  if (auto over = overload(rows, robot.limits.payload_kg)) found.checks.push_back(std::move(*over));
  return found;
}

}  // namespace joulecast::gap
