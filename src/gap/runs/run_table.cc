#include "gap/runs/run_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "base/bounds.h"
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

constexpr std::array<RunColumn, place_count> run_table_columns{
    {{"run", "", "name of the run; default: its line"},
     {"table", "", "runs of one table have their day, floor and driver in common"},
     {"distance_m", "m", "distance driven; required"},
     {"speed_m_s", "m/s", "highest speed; required"},
     {"acceleration_m_s2", "m/s^2", "of starting and braking; default: the robot's limit"},
     {"payload_kg", "kg", "declared payload; default: none"},
     {"turn_radius_m", "m", "mean radius of the arc in the middle of the way; empty: straight"},
     {"turn_deg", "degrees", "angle of that arc; empty: the whole way is on it"},
     {"turn_side", "left|right", "required with a turn"},
     {"standstill_s", "s", "time at rest with the robot on; default: none"},
     {"climb_m", "m", "height of the end above the start; empty: unknown"},
     {"energy_j", "J", "energy measured at the battery, with idle power"},
     {"right_j", "J", "or measured at the right motor"},
     {"left_j", "J", "and at the left motor"},
     {"model_j", "J", "modelled energy at the battery; default: by the robot file"},
     {"model_right_j", "J", "or at the right motor"},
     {"model_left_j", "J", "and at the left motor"}}};
// All other columns are named by their kind and their name.
constexpr std::array<RunColumn, 2> own_columns{
    {{"covariate:NAME", "any", "a number that may be a cause: computer load, temperature, ..."},
     {"label:NAME", "",
      "a word that may make a difference: surface, driver, ...; --compare-by NAME compares"}}};
constexpr std::string_view covariate_prefix = "covariate:", label_prefix = "label:";

// The columns of a table by their place.
struct Header {
  std::array<std::optional<std::size_t>, place_count> at;
  std::vector<std::pair<std::size_t, std::size_t>> covariates, labels;  // place, index in the set
};

class RunTableRow {
 public:
  RunTableRow(const std::vector<std::string_view>& fields, const Header& header, std::string where)
      : fields_(fields), header_(header), where_(std::move(where)) {}

  std::string_view text(Place place) const {
    return header_.at[place] ? fields_[*header_.at[place]] : std::string_view();
  }
  std::string_view field(std::size_t at) const { return trimmed(fields_[at]); }
  const Header& header() const { return header_; }

  tl::unexpected<Error> wrong(Place place, const std::string& constraint) const {
    return wrong(run_table_columns[place].name, text(place), constraint);
  }
  tl::unexpected<Error> wrong(std::string_view column, std::string_view cell,
                              const std::string& constraint) const {
    return invalid(where_, "column " + std::string(column) + ": '" + std::string(cell) + "' " + constraint);
  }

  // NaN where the cell is empty or the column missing.
  Result<double> number(Place place, const Bounds& bounds, std::string_view unit) const {
    const Result<double> value = parsed(trimmed(text(place)));
    if (!value || !(std::isnan(*value) || bounds.contain(*value)))
      return wrong(place, requirement(bounds, unit));
    return value;
  }
  Result<double> required(Place place, const Bounds& bounds, std::string_view unit) const {
    Result<double> value = number(place, bounds, unit);
    if (value && std::isnan(*value)) return wrong(place, "is required and " + requirement(bounds, unit));
    return value;
  }

  // NaN for an empty cell.
  static Result<double> parsed(std::string_view cell) {
    if (cell.empty()) return MissionRun::absent;
    double value = 0;
    const auto [end, fault] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (fault != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value))
      return invalid("", "");
    return value;
  }

 private:
  static std::string_view trimmed(std::string_view cell) {
    while (!cell.empty() && cell.front() == ' ') cell.remove_prefix(1);
    while (!cell.empty() && (cell.back() == ' ' || cell.back() == '\r')) cell.remove_suffix(1);
    return cell;
  }

  const std::vector<std::string_view>& fields_;
  const Header& header_;
  std::string where_;
};

Result<void> read_turn(const RunTableRow& row, RunConditions& at) {
  TRY_ASSIGN(const auto radius, row.number(turn_radius, {0.01, 1e6}, "m"));
  TRY_ASSIGN(const auto angle, row.number(turn_angle, {0, 36000}, "degrees"));
  const std::string_view side = row.text(turn_side);
  if (std::isnan(radius)) {
    if (angle > 0) return row.wrong(turn_angle, "needs turn_radius_m");
    return {};
  }
  if (side != "left" && side != "right") return row.wrong(turn_side, "must be left or right");
  const double turn = std::isnan(angle) ? at.distance_m / radius : angle * std::numbers::pi / 180;
  if (turn * radius > at.distance_m * (1 + 1e-9))
    return row.wrong(turn_angle, "is an arc longer than distance_m");
  at.turn_radius_m = radius;
  at.turn_rad = side == "left" ? turn : -turn;
  return {};
}

Result<void> read_energies(const RunTableRow& row, MissionRun& run) {
  constexpr Bounds bounds{1e-9, 1e12};
  const std::array<std::pair<Place, double*>, 6> cells{{{energy, &run.energy_j},
                                                        {right_energy, &run.motor_j[0]},
                                                        {left_energy, &run.motor_j[1]},
                                                        {model_energy, &run.model_energy_j},
                                                        {model_right, &run.model_motor_j[0]},
                                                        {model_left, &run.model_motor_j[1]}}};
  for (const auto& [place, value] : cells) {
    TRY_ASSIGN(const auto read, row.number(place, bounds, "J"));
    *value = read;
  }
  const auto given = [](double v) { return !std::isnan(v); };
  if (given(run.motor_j[0]) != given(run.motor_j[1]))
    return row.wrong(given(run.motor_j[0]) ? left_energy : right_energy,
                     "is required with the other motor's");
  if (given(run.energy_j) == run.by_motor())
    return row.wrong(energy, run.by_motor() ? "must be empty where right_j and left_j are given"
                                            : "is required unless right_j and left_j are given");
  if (given(run.model_motor_j[0]) != given(run.model_motor_j[1]))
    return row.wrong(given(run.model_motor_j[0]) ? model_left : model_right,
                     "is required with the other motor's");
  if (run.by_motor() ? given(run.model_energy_j) : given(run.model_motor_j[0]))
    return row.wrong(run.by_motor() ? model_energy : model_right,
                     "must be where the measured energy is: at the battery or at the motors");
  return {};
}

Result<MissionRun> read_run(const RunTableRow& row, std::size_t line, const robot::RobotModel& robot,
                            const RunSet& set) {
  MissionRun run;
  run.name = row.text(run_label).empty() ? "line " + std::to_string(line) : std::string(row.text(run_label));
  run.table = row.text(table_name);
  struct Cell {
    Place place;
    double* value;
    Bounds bounds;
    std::string_view unit;
    double fallback;
  };
  RunConditions& at = run.at;
  const std::array<Cell, 6> cells{
      {{distance, &at.distance_m, {1e-3, 1e7}, "m", MissionRun::absent},
       {speed, &at.speed_m_s, {1e-3, 100}, "m/s", MissionRun::absent},
       {acceleration, &at.acceleration_m_s2, {1e-4, 100}, "m/s^2", robot.limits.acceleration_m_s2},
       {payload, &at.payload_kg, {0, 1e5}, "kg", 0},
       {standstill, &at.standstill_s, {0, 1e7}, "s", 0},
       {climb, &at.climb_m, {-1e5, 1e5}, "m", MissionRun::absent}}};
  for (const Cell& cell : cells) {
    TRY_ASSIGN(auto value, std::isnan(cell.fallback) && cell.place != climb
                               ? row.required(cell.place, cell.bounds, cell.unit)
                               : row.number(cell.place, cell.bounds, cell.unit));
    *cell.value = std::isnan(value) ? cell.fallback : value;
  }
  TRY(read_turn(row, at));
  if (std::fabs(at.climb_m) > at.distance_m) return row.wrong(climb, "is more than distance_m");
  TRY(read_energies(row, run));
  for (const auto& [place, index] : row.header().covariates) {
    const auto value = RunTableRow::parsed(row.field(place));
    if (!value) return row.wrong(set.covariates[index], row.field(place), "must be a number");
    run.covariates.resize(std::max(run.covariates.size(), index + 1), MissionRun::absent);
    run.covariates[index] = *value;
  }
  for (const auto& [place, index] : row.header().labels) {
    run.labels.resize(std::max(run.labels.size(), index + 1));
    run.labels[index] = row.field(place);
  }
  return run;
}

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
    const auto found = std::ranges::find(run_table_columns, name, &RunColumn::name);
    if (found == run_table_columns.end()) {
      return invalid(where, "column " + names[c] + " is none of a table of runs; covariate:" + names[c] +
                                " or label:" + names[c] + " would make it a possible cause");
    }
    header.at[static_cast<std::size_t>(found - run_table_columns.begin())] = c;
  }
  for (const Place needed : {distance, speed}) {
    if (!header.at[needed])
      return invalid(where, "column " + std::string(run_table_columns[needed].name) + " is required");
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
    TRY_ASSIGN(auto run, read_run({fields, header, file.name + ": line " + std::to_string(table->line())},
                                  table->line(), robot, set));
    if (several && run.table.empty()) run.table = file.name;
    set.runs.push_back(std::move(run));
    if (set.runs.size() > most_runs)
      return fail(Fault::too_large, file.name, "holds more than " + std::to_string(most_runs) + " runs");
  }
}

}  // namespace

std::vector<RunColumn> run_columns() {
  std::vector<RunColumn> all(run_table_columns.begin(), run_table_columns.end());
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
  for (const RunFile& file : files) {
    TRY(read_file(file, robot, files.size() > 1, set));
  }
  if (set.runs.size() < fewest_runs) {
    return invalid(files.front().name, "holds " + std::to_string(set.runs.size()) + " runs, at least " +
                                           std::to_string(fewest_runs) + " are needed");
  }
  for (MissionRun& run : set.runs) {
    run.covariates.resize(set.covariates.size(), MissionRun::absent);
    run.labels.resize(set.labels.size());
  }
  return set;
}

}  // namespace joulecast::gap
