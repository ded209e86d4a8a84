#include <algorithm>
#include <array>
#include <cmath>
#include <ranges>

#include "gap/posterior/hold_out.h"
#include "gap/runs/run_rows.h"
#include "gap/verdict/words.h"
#include "plausibility/evaluation.h"
#include "statistics/regression.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t most_told = 5;  // outliers one by one
constexpr double gross = 6;           // spreads of the regression, beyond which a run is an outlier

// Wh and kJ differ by a factor of 3.6, and files that lack a base load are off by as much. The energy per
// metre separates them: loads are no part of it.
void check_unit(const RunRows& rows, const std::string& column, std::vector<Check>& checks) {
  constexpr double off = 4;     // most of a run's ratio from either unit
  constexpr double near = 1.5;  // of the energy per metre
  constexpr std::array<std::pair<const char*, double>, 2> units{{{"Wh", 3600}, {"kJ", 1000}}};
  const std::vector<double> modelled = rows.modelled_j();
  std::vector<double> ratio;
  for (std::size_t k = 0; k < modelled.size(); ++k) {
    const double measured = rows.runs[k].measured_j(), smaller = modelled[k] / measured;
    if (smaller > off * units[0].second || smaller < units[1].second / off) return;
    ratio.push_back(measured / modelled[k]);
  }
  const posterior::Data& d = rows.data;
  const Eigen::MatrixXd x = posterior::term_columns(d).x;
  const auto per_m = [&](const Eigen::VectorXd& power) {
    return statistics::robust_regression(x, power, d.rows.blocks()).coefficients[1];
  };
  const Eigen::VectorXd measured = d.rows.measured_w();
  const double smaller = per_m(posterior::predicted_power(d, d.in_file)) / per_m(measured);
  std::string unit = "Wh or kJ";
  for (const auto& [name, in_j] : units)
    if (smaller < near * in_j && smaller > in_j / near) unit = name;
  const double usual = statistics::median(std::move(ratio));
  add_check(
      checks, "energy_unit", column, {usual}, true,
      "{} looks given in {}: every run's is about 1/{:.0f} of what the model takes. joulecast expects J "
      "(1 Wh is 3600 J, 1 kJ is 1000 J).",
      column, unit, 1 / usual);
}

void check_constant(const RunRows& rows, const std::string& column, std::vector<Check>& checks) {
  constexpr double same = 1e-6, differs = 1.2;
  const std::vector<double> modelled = rows.modelled_j();
  const auto [least, most] = std::ranges::minmax(rows.runs | std::views::transform(&MissionRun::measured_j));
  const auto [low, high] = std::ranges::minmax(modelled);
  if (most > (1 + same) * least || high < differs * low) return;
  add_check(checks, "constant_channel", column, {most}, true,
            "{} is {} J in all {} runs, where the model has {} to {} J: a constant, no measurement.", column,
            brief(most), modelled.size(), brief(low), brief(high));
}

void check_outliers(const RunRows& rows, const std::string& column, RunChecks& found) {
  constexpr std::size_t fewest = 10;  // runs, of which a spread can be estimated
  if (rows.runs.size() < fewest) return;
  const auto [usual, apart] = rows.regression();
  std::vector<std::size_t> far;
  for (std::size_t k = 0; k < apart.size(); ++k)
    if (std::fabs(apart[k]) > gross) far.push_back(k);
  // A deviation of a tenth or more of the runs is systematic.
  if (10 * far.size() >= apart.size()) return;
  std::ranges::sort(far, {}, [&, &by = apart](std::size_t k) { return -std::fabs(by[k]); });
  for (std::size_t n = 0; n < std::min(far.size(), most_told); ++n) {
    const MissionRun& run = rows.runs[far[n]];
    add_check(
        found.checks, "run_apart", column, {apart[far[n]]}, false,
        "Run {} took {} J; from the others about {} J are expected: a wrong value, or another event. Its "
        "weight is small.",
        run.name, brief(run.measured_j()), brief(std::max(0.0, usual[far[n]])));
  }
  found.apart = std::move(far);
}

void check_payload(const RunRows& rows, double limit_kg, std::vector<Check>& checks) {
  const auto& run =
      *std::ranges::max_element(rows.runs, {}, [](const MissionRun& r) { return r.at.payload_kg; });
  if (limit_kg > 0 && run.at.payload_kg > limit_kg)
    add_check(checks, "payload_over_limit", "payload_kg", {run.at.payload_kg / limit_kg}, false,
              "payload_kg of run {} is {}, above the file's limits.payload_kg, {}.", run.name,
              brief(run.at.payload_kg), brief(limit_kg));
}

}  // namespace

RunChecks check_runs(const RunRows& rows, const robot::RobotModel& robot) {
  const std::string column = rows.by_motor ? "right_j, left_j" : "energy_j";
  RunChecks found;
  for (const auto check : {check_unit, check_constant}) {
    check(rows, column, found.checks);
    if (!found.checks.empty()) return found;
  }
  check_outliers(rows, column, found);
  check_payload(rows, robot.limits.payload_kg, found.checks);
  return found;
}

}  // namespace joulecast::gap
