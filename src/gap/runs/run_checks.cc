#include "gap/runs/run_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "gap/runs/run_referee.h"
#include "gap/verdict/words.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t most_told = 5;  // outliers one by one

struct Energies {
  std::vector<double> measured, modelled;
};

Energies energies_of(const RunColumns& columns) {
  Energies e;
  for (std::size_t k = 0; k < columns.runs().size(); ++k) {
    e.measured.push_back(columns.runs()[k].measured_j());
    e.modelled.push_back(columns.modelled(k, {}).sum_j);
  }
  return e;
}

// Wh and kJ are a factor of 3.6 apart, by which files that lack a base load are off. What a metre takes tells
// them apart, as loads are no part of it.
std::optional<Check> other_unit(const RunColumns& columns, const std::string& column) {
  constexpr double off = 4;     // most of a run's ratio from either unit
  constexpr double near = 1.5;  // of what a metre takes
  constexpr std::array<std::pair<const char*, double>, 2> units{{{"Wh", 3600}, {"kJ", 1000}}};
  const Energies e = energies_of(columns);
  for (std::size_t k = 0; k < e.measured.size(); ++k) {
    const double smaller = e.modelled[k] / e.measured[k];
    if (smaller > off * units[0].second || smaller < units[1].second / off) return std::nullopt;
  }
  const RunReferee referee(columns);
  const auto per_m = [&](const std::vector<double>& energy) {
    const auto term = std::ranges::find(referee.terms(), "distance", &RefereeTerm::name);
    return referee.fit(energy).regression.coefficients[term - referee.terms().begin()];
  };
  const double smaller = per_m(e.modelled) / per_m(e.measured);
  std::string unit = "Wh or kJ";
  for (const auto& [name, in_j] : units) {
    if (smaller < near * in_j && smaller > in_j / near) unit = name;
  }
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

std::optional<Check> constant(const RunColumns& columns, const std::string& column) {
  constexpr double same = 1e-6, differs = 1.2;
  const auto [measured, modelled] = energies_of(columns);
  const auto [least, most] = std::ranges::minmax(measured);
  const auto [low, high] = std::ranges::minmax(modelled);
  if (most > (1 + same) * least || high < differs * low) return std::nullopt;
  return Check{
      "constant_channel",
      column,
      most,
      {windows::missing, windows::missing},
      fmt::format("{} is {} J in all {} runs, where the model takes {} to {} J: a constant written in, no "
                  "measurement.",
                  column, brief(most), measured.size(), brief(low), brief(high)),
      true};
}

std::vector<Check> outliers(const RunColumns& columns, const std::string& column) {
  constexpr std::size_t fewest = 10;  // runs, of which a spread can be told
  const std::vector<double> measured = energies_of(columns).measured;
  if (measured.size() < fewest) return {};
  const RunReferee referee(columns);
  const std::vector<double> apart = referee.apart(measured), usual = referee.fit(measured).energy_j;
  std::vector<std::size_t> far;
  for (std::size_t k = 0; k < apart.size(); ++k) {
    if (std::fabs(apart[k]) > RunReferee::gross) far.push_back(k);
  }
  // What a tenth or more of the runs do is no accident.
  if (10 * far.size() >= apart.size()) return {};
  std::ranges::sort(far, {}, [&](std::size_t k) { return -std::fabs(apart[k]); });
  if (far.size() > most_told) far.resize(most_told);
  std::vector<Check> checks;
  for (const std::size_t k : far) {
    checks.push_back(
        {"run_apart",
         column,
         apart[k],
         {windows::missing, windows::missing},
         fmt::format("Run {} took {} J, where the others let expect about {} J: a wrong value, or "
                     "something else happened. It counts little.",
                     columns.runs()[k].name, brief(measured[k]), brief(std::max(0.0, usual[k])))});
  }
  return checks;
}

}  // namespace

std::vector<Check> check_runs(const RunColumns& columns) {
  const std::string column = columns.by_motor() ? "right_j, left_j" : "energy_j";
  for (const auto check : {other_unit, constant}) {
    if (auto found = check(columns, column)) return {std::move(*found)};
  }
  return outliers(columns, column);
}

}  // namespace joulecast::gap
