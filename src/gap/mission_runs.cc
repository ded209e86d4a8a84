#include "gap/mission_runs.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <optional>

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
  energy,
  right_energy,
  left_energy,
  model_energy,
  model_right,
  model_left,
  place_count
};

constexpr std::array<RunColumn, place_count> columns{
    {{"run", "", "name of the run; its line by default"},
     {"table", "", "runs of one table share what scatters between tables (day, floor, driver)"},
     {"distance_m", "m", "driven; required"},
     {"speed_m_s", "m/s", "highest; required"},
     {"acceleration_m_s2", "m/s^2", "of starting and braking; the robot's limit by default"},
     {"payload_kg", "kg", "declared; none by default"},
     {"turn_radius_m", "m", "mean radius of the arc in the middle of the way; empty: straight"},
     {"turn_deg", "degrees", "angle of that arc; empty: the whole way is on it"},
     {"turn_side", "left|right", "required with a turn"},
     {"standstill_s", "s", "standing with the robot on; none by default"},
     {"energy_j", "J", "measured at the battery, idle power included"},
     {"right_j", "J", "or measured at the right motor"},
     {"left_j", "J", "and at the left motor"},
     {"model_j", "J", "what the model in question gave at the battery; by default the robot file is asked"},
     {"model_right_j", "J", "the same at the right motor"},
     {"model_left_j", "J", "and at the left motor"}}};

class Row {
 public:
  Row(const std::vector<std::string_view>& fields,
      const std::array<std::optional<std::size_t>, place_count>& at, std::string where)
      : fields_(fields), at_(at), where_(std::move(where)) {}

  std::string_view text(Place place) const { return at_[place] ? fields_[*at_[place]] : std::string_view(); }

  tl::unexpected<Error> wrong(Place place, const std::string& constraint) const {
    return invalid(where_, "column " + std::string(columns[place].name) + ": '" + std::string(text(place)) +
                               "' " + constraint);
  }

  // NaN where the cell is empty or the column missing.
  Result<double> number(Place place, double low, double high, const std::string& constraint) const {
    std::string_view cell = text(place);
    while (!cell.empty() && cell.front() == ' ') cell.remove_prefix(1);
    while (!cell.empty() && cell.back() == ' ') cell.remove_suffix(1);
    if (cell.empty()) return MissionRun::absent;
    double value = 0;
    const auto [end, fault] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (fault != std::errc() || end != cell.data() + cell.size() || !(value >= low && value <= high))
      return wrong(place, constraint);
    return value;
  }
  Result<double> required(Place place, double low, double high, const std::string& constraint) const {
    Result<double> value = number(place, low, high, constraint);
    if (value && std::isnan(*value)) return wrong(place, "is required and " + constraint);
    return value;
  }

 private:
  const std::vector<std::string_view>& fields_;
  const std::array<std::optional<std::size_t>, place_count>& at_;
  std::string where_;
};

Result<void> read_turn(const Row& row, RunConditions& at) {
  const auto radius = row.number(turn_radius, 0.01, 1e6, "must be from 0.01 to 1e6 m");
  if (!radius) return tl::unexpected(radius.error());
  const auto angle = row.number(turn_angle, 0, 36000, "must be from 0 to 36000 degrees");
  if (!angle) return tl::unexpected(angle.error());
  const std::string_view side = row.text(turn_side);
  if (std::isnan(*radius)) {
    if (*angle > 0) return row.wrong(turn_angle, "needs turn_radius_m");
    return {};
  }
  if (side != "left" && side != "right") return row.wrong(turn_side, "must be left or right");
  const double turn = std::isnan(*angle) ? at.distance_m / *radius : *angle * std::numbers::pi / 180;
  if (turn * *radius > at.distance_m * (1 + 1e-9))
    return row.wrong(turn_angle, "is an arc longer than distance_m");
  at.turn_radius_m = *radius;
  at.turn_rad = side == "left" ? turn : -turn;
  return {};
}

Result<void> read_energies(const Row& row, MissionRun& run) {
  const std::string bound = "must be above 0 and below 1e12 J";
  constexpr double least = 1e-9, most = 1e12;
  const std::array<std::pair<Place, double*>, 6> cells{{{energy, &run.energy_j},
                                                        {right_energy, &run.motor_j[0]},
                                                        {left_energy, &run.motor_j[1]},
                                                        {model_energy, &run.model_energy_j},
                                                        {model_right, &run.model_motor_j[0]},
                                                        {model_left, &run.model_motor_j[1]}}};
  for (const auto& [place, value] : cells) {
    const auto read = row.number(place, least, most, bound);
    if (!read) return tl::unexpected(read.error());
    *value = *read;
  }
  const auto given = [](double v) { return !std::isnan(v); };
  if (given(run.motor_j[0]) != given(run.motor_j[1]))
    return row.wrong(given(run.motor_j[0]) ? left_energy : right_energy,
                     "is required beside the other motor's");
  if (given(run.energy_j) == run.by_motor())
    return row.wrong(energy, run.by_motor() ? "must be empty where right_j and left_j are given"
                                            : "is required unless right_j and left_j are given");
  if (given(run.model_motor_j[0]) != given(run.model_motor_j[1]))
    return row.wrong(given(run.model_motor_j[0]) ? model_left : model_right,
                     "is required beside the other motor's");
  if (run.by_motor() ? given(run.model_energy_j) : given(run.model_motor_j[0]))
    return row.wrong(run.by_motor() ? model_energy : model_right,
                     "must be where the measured energy is: at the battery or at the motors");
  return {};
}

Result<MissionRun> read_run(const Row& row, std::size_t line, const robot::RobotModel& robot) {
  MissionRun run;
  run.label = row.text(run_label).empty() ? "line " + std::to_string(line) : std::string(row.text(run_label));
  run.table = row.text(table_name);
  struct Cell {
    Place place;
    double* value;
    double low, high, fallback;
    const char* constraint;
  };
  RunConditions& at = run.at;
  const std::array<Cell, 5> cells{
      {{distance, &at.distance_m, 1e-3, 1e7, MissionRun::absent, "must be from 0.001 to 1e7 m"},
       {speed, &at.speed_m_s, 1e-3, 100, MissionRun::absent, "must be from 0.001 to 100 m/s"},
       {acceleration, &at.acceleration_m_s2, 1e-4, 100, robot.limits.acceleration_m_s2,
        "must be from 0.0001 to 100 m/s^2"},
       {payload, &at.payload_kg, 0, 1e5, 0, "must be from 0 to 1e5 kg"},
       {standstill, &at.standstill_s, 0, 1e7, 0, "must be from 0 to 1e7 s"}}};
  for (const Cell& cell : cells) {
    auto value = std::isnan(cell.fallback) ? row.required(cell.place, cell.low, cell.high, cell.constraint)
                                           : row.number(cell.place, cell.low, cell.high, cell.constraint);
    if (!value) return tl::unexpected(value.error());
    *cell.value = std::isnan(*value) ? cell.fallback : *value;
  }
  if (auto turn = read_turn(row, at); !turn) return tl::unexpected(turn.error());
  if (auto energies = read_energies(row, run); !energies) return tl::unexpected(energies.error());
  return run;
}

}  // namespace

std::vector<RunColumn> run_columns() {
  return {columns.begin(), columns.end()};
}

Result<std::vector<MissionRun>> read_mission_runs(std::string_view csv, const std::string& name,
                                                  const robot::RobotModel& robot) {
  auto table = telemetry::CsvTable::open(csv, ',');
  if (!table) return invalid(name, describe(table.error()));
  std::array<std::optional<std::size_t>, place_count> at;
  for (std::size_t c = 0; c < table->header().size(); ++c) {
    const auto found = std::ranges::find(columns, table->header()[c], &RunColumn::name);
    if (found == columns.end())
      return invalid(name + ": line 1", "column " + table->header()[c] + " is none of a table of runs");
    auto& place = at[static_cast<std::size_t>(found - columns.begin())];
    if (place) return invalid(name + ": line 1", "column " + table->header()[c] + " appears twice");
    place = c;
  }
  for (const Place needed : {distance, speed}) {
    if (!at[needed])
      return invalid(name + ": line 1", "column " + std::string(columns[needed].name) + " is required");
  }
  std::vector<MissionRun> runs;
  std::vector<std::string_view> fields;
  for (;;) {
    const auto more = table->next(fields);
    if (!more) return invalid(name, describe(more.error()));
    if (!*more) break;
    auto run = read_run({fields, at, name + ": line " + std::to_string(table->line())}, table->line(), robot);
    if (!run) return tl::unexpected(std::move(run.error()));
    runs.push_back(std::move(*run));
    if (runs.size() > most_runs)
      return fail(Fault::too_large, name, "holds more than " + std::to_string(most_runs) + " runs");
  }
  if (runs.size() < fewest_runs)
    return invalid(name, "holds " + std::to_string(runs.size()) + " runs, at least " +
                             std::to_string(fewest_runs) + " are needed");
  return runs;
}

}  // namespace joulecast::gap
