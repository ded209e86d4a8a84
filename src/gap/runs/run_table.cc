#include "gap/runs/run_table.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "base/bounds.h"
#include "base/text.h"
#include "base/try.h"
#include "signals/covariates.h"
#include "telemetry/csv_table.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t fewest_runs = 3, most_runs = 1000;

enum Place : std::size_t {
  run_label,
  table_name,
  distance,
  speed,
  acceleration,
  payload,
  turn_radius,
  turn_angle,
  turn_side,
  standstill,
  climb,
  energy,
  right_energy,
  left_energy,
  model_energy,
  model_right,
  model_left,
  place_count
};

struct Column {
  RunColumn about;
  std::optional<Bounds> bounds{};  // of a number
  bool required = false;
};
constexpr Bounds energy_j{1e-9, 1e12};
constexpr std::array<Column, place_count> run_table_columns{
    {{{"run", "", "name of the run; default: its line"}},
     {{"table", "", "runs of one table have their day, floor and driver in common"}},
     {{"distance_m", "m", "distance driven; required"}, Bounds{1e-3, 1e7}, true},
     {{"speed_m_s", "m/s", "highest speed; required"}, Bounds{1e-3, 100}, true},
     {{"acceleration_m_s2", "m/s^2", "of starting and braking; default: the robot's limit"},
      Bounds{1e-4, 100}},
     {{"payload_kg", "kg", "declared payload; default: none"}, Bounds{0, 1e5}},
     {{"turn_radius_m", "m", "mean radius of the arc in the middle of the path; empty: straight"},
      Bounds{0.01, 1e6}},
     {{"turn_deg", "degrees", "angle of that arc; empty: the whole path is the arc"}, Bounds{0, 36000}},
     {{"turn_side", "left|right", "required with a turn"}},
     {{"standstill_s", "s", "time at rest with the robot on; default: none"}, Bounds{0, 1e7}},
     {{"climb_m", "m", "height of the end above the start; empty: unknown"}, Bounds{-1e5, 1e5}},
     {{"energy_j", "J", "energy measured at the battery, with idle power"}, energy_j},
     {{"right_j", "J", "or measured at the right motor"}, energy_j},
     {{"left_j", "J", "and at the left motor"}, energy_j},
     {{"model_j", "J", "modelled energy at the battery; default: by the robot file"}, energy_j},
     {{"model_right_j", "J", "or at the right motor"}, energy_j},
     {{"model_left_j", "J", "and at the left motor"}, energy_j}}};
// All other columns are named by their kind and their name.
constexpr std::array<RunColumn, 2> own_columns{
    {{"covariate:NAME", "any", "a number that may be a cause: computer load, temperature, ..."},
     {"label:NAME", "", "a category, such as surface or driver; --compare-by NAME compares"}}};
constexpr std::string_view covariate_prefix = "covariate:", label_prefix = "label:";

// The columns of a table by their place.
struct Header {
  std::array<std::optional<std::size_t>, place_count> at;
  std::vector<std::pair<std::size_t, std::size_t>> covariates, labels;  // place, index in the set
};

// NaN for an empty cell; nothing for one that is no finite number.
std::optional<double> number_in(std::string_view cell) {
  return cell.empty() ? MissionRun::absent : to_number<double>(cell);
}

bool given(double value) {
  return !std::isnan(value);
}

class RunTableRow {
 public:
  RunTableRow(const std::vector<std::string_view>& fields, const Header& header, std::string where)
      : fields_(fields), header_(header), where_(std::move(where)) {}

  Result<MissionRun> run(std::size_t line, const robot::RobotModel& robot, const RunSet& set) {
    for (std::size_t k = 0; k < place_count; ++k) {
      const Column& column = run_table_columns[k];
      if (!column.bounds) continue;
      const auto value = number_in(trimmed(text(Place(k))));
      if (!value || (given(*value) && !column.bounds->contain(*value)) || (column.required && !given(*value)))
        return wrong(Place(k), (value && !given(*value) ? "is required and " : "") +
                                   requirement(*column.bounds, column.about.unit));
      number_[k] = *value;
    }
    MissionRun run;
    run.name = text(run_label).empty() ? "line " + std::to_string(line) : std::string(text(run_label));
    run.table = text(table_name);
    const auto otherwise = [&](Place place, double value) {
      return given(number_[place]) ? number_[place] : value;
    };
    run.at = {.distance_m = number_[distance],
              .speed_m_s = number_[speed],
              .acceleration_m_s2 = otherwise(acceleration, robot.limits.acceleration_m_s2),
              .payload_kg = otherwise(payload, 0),
              .standstill_s = otherwise(standstill, 0),
              .climb_m = number_[climb]};
    run.energy_j = number_[energy];
    run.motor_j = {number_[right_energy], number_[left_energy]};
    run.model_energy_j = number_[model_energy];
    run.model_motor_j = {number_[model_right], number_[model_left]};
    TRY(read_turn(run.at));
    if (std::fabs(run.at.climb_m) > run.at.distance_m) return wrong(climb, "is more than distance_m");
    TRY(check_energies(run));
    run.covariates.resize(set.covariates.size(), MissionRun::absent);
    for (const auto& [place, index] : header_.covariates) {
      const auto value = number_in(trimmed(fields_[place]));
      if (!value) return wrong(set.covariates[index], trimmed(fields_[place]), "must be a number");
      run.covariates[index] = *value;
    }
    run.labels.resize(set.labels.size());
    for (const auto& [place, index] : header_.labels) run.labels[index] = trimmed(fields_[place]);
    return run;
  }

 private:
  std::string_view text(Place place) const {
    return header_.at[place] ? fields_[*header_.at[place]] : std::string_view();
  }

  tl::unexpected<Error> wrong(Place place, const std::string& constraint) const {
    return wrong(run_table_columns[place].about.name, text(place), constraint);
  }
  tl::unexpected<Error> wrong(std::string_view column, std::string_view cell,
                              const std::string& constraint) const {
    return invalid(where_, "column " + std::string(column) + ": '" + std::string(cell) + "' " + constraint);
  }

  Result<void> read_turn(RunConditions& at) const {
    const double radius = number_[turn_radius], angle = number_[turn_angle];
    const std::string_view side = text(turn_side);
    if (!given(radius)) {
      if (angle > 0) return wrong(turn_angle, "needs turn_radius_m");
      return {};
    }
    if (side != "left" && side != "right") return wrong(turn_side, "must be left or right");
    const double turn = given(angle) ? angle * std::numbers::pi / 180 : at.distance_m / radius;
    if (turn * radius > at.distance_m * (1 + 1e-9))
      return wrong(turn_angle, "is an arc longer than distance_m");
    at.turn_radius_m = radius;
    at.turn_rad = side == "left" ? turn : -turn;
    return {};
  }

  Result<void> check_energies(const MissionRun& run) const {
    for (const Place right : {right_energy, model_right}) {
      const Place left = Place(right + 1);
      if (given(number_[right]) != given(number_[left]))
        return wrong(given(number_[right]) ? left : right, "is required with the other motor's");
    }
    if (given(run.energy_j) == run.by_motor())
      return wrong(energy, run.by_motor() ? "must be empty where right_j and left_j are given"
                                          : "is required unless right_j and left_j are given");
    if (run.by_motor() ? given(run.model_energy_j) : given(run.model_motor_j[0]))
      return wrong(run.by_motor() ? model_energy : model_right,
                   "must be where the measured energy is: at the battery or at the motors");
    return {};
  }

  const std::vector<std::string_view>& fields_;
  const Header& header_;
  std::string where_;
  std::array<double, place_count> number_{};  // NaN: not given
};

// The place of a name in a list; a new name is appended.
std::size_t place_in(std::vector<std::string>& names, std::string_view name) {
  const auto found = std::ranges::find(names, name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  names.emplace_back(name);
  return names.size() - 1;
}

Result<Header> read_header(std::span<const std::string> names, const std::string& where, RunSet& set) {
  Header header;
  std::set<std::string> seen;
  for (std::size_t c = 0; c < names.size(); ++c) {
    const std::string_view name = names[c];
    if (!seen.insert(names[c]).second) return invalid(where, "column " + names[c] + " appears twice");
    const auto own = [&](std::string_view prefix, std::vector<std::string>& list) -> Result<std::size_t> {
      const std::string_view rest = name.substr(prefix.size());
      if (!signals::is_valid_covariate_name(rest) || signals::is_label(rest))
        return invalid(where,
                       "column " + names[c] + ": a name is 1 to 47 of letters, digits, '.', '_' and '-'");
      return place_in(list, rest);
    };
    const bool covariate = name.starts_with(covariate_prefix);
    if (covariate || name.starts_with(label_prefix)) {
      TRY_ASSIGN(const auto index,
                 own(covariate ? covariate_prefix : label_prefix, covariate ? set.covariates : set.labels));
      (covariate ? header.covariates : header.labels).emplace_back(c, index);
      continue;
    }
    const auto found =
        std::ranges::find(run_table_columns, name, [](const Column& column) { return column.about.name; });
    if (found == run_table_columns.end())
      return invalid(where, "column " + names[c] + " is none of a table of runs; covariate:" + names[c] +
                                " or label:" + names[c] + " would make it a possible cause");
    header.at[static_cast<std::size_t>(found - run_table_columns.begin())] = c;
  }
  for (std::size_t k = 0; k < place_count; ++k) {
    if (run_table_columns[k].required && !header.at[k])
      return invalid(where, "column " + std::string(run_table_columns[k].about.name) + " is required");
  }
  return header;
}

Result<void> read_file(const RunFile& file, const robot::RobotModel& robot, bool several, RunSet& set) {
  auto table = telemetry::CsvTable::open(file.text, ',');
  if (!table) return invalid(file.name, describe(table.error()));
  TRY_ASSIGN(const auto header, read_header(table->header(), file.name + ": line 1", set));
  std::vector<std::string_view> fields;
  for (;;) {
    const auto more = table->next(fields);
    if (!more) return invalid(file.name, describe(more.error()));
    if (!*more) return {};
    TRY_ASSIGN(auto run, RunTableRow(fields, header, file.name + ": line " + std::to_string(table->line()))
                             .run(table->line(), robot, set));
    if (several && run.table.empty()) run.table = file.name;
    set.runs.push_back(std::move(run));
    if (set.runs.size() > most_runs)
      return fail(Fault::too_large, file.name, "holds more than " + std::to_string(most_runs) + " runs");
  }
}

}  // namespace

std::vector<RunColumn> run_columns() {
  std::vector<RunColumn> all;
  for (const Column& column : run_table_columns) all.push_back(column.about);
  all.insert(all.end(), own_columns.begin(), own_columns.end());
  return all;
}

Result<std::vector<std::string>> RunSet::groups_by(std::string_view label) const {
  std::vector<std::string> groups;
  const auto found = std::ranges::find(labels, label);
  if (label != "table" && found == labels.end()) {
    std::string known = "table";
    for (const std::string& name : labels) known += ", " + name;
    return invalid("--compare-by", std::string(label) + " is no label of these runs; they have " + known);
  }
  for (const MissionRun& run : runs) {
    groups.push_back(label == "table" ? run.table
                                      : run.labels[static_cast<std::size_t>(found - labels.begin())]);
    if (groups.back().empty())
      return invalid("--compare-by", "run " + run.name + " has no " + std::string(label));
  }
  return groups;
}

Result<RunSet> read_runs(std::span<const RunFile> files, const robot::RobotModel& robot) {
  RunSet set;
  for (const RunFile& file : files) TRY(read_file(file, robot, files.size() > 1, set));
  if (set.runs.size() < fewest_runs)
    return invalid(files.front().name, "holds " + std::to_string(set.runs.size()) + " runs, at least " +
                                           std::to_string(fewest_runs) + " are needed");
  for (MissionRun& run : set.runs) {
    run.covariates.resize(set.covariates.size(), MissionRun::absent);
    run.labels.resize(set.labels.size());
  }
  return set;
}

}  // namespace joulecast::gap
