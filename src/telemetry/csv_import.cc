#include "telemetry/csv_import.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>

#include "base/median.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "signals/gaps.h"
#include "signals/ids.h"
#include "telemetry/codec.h"
#include "telemetry/import_table.h"
#include "telemetry/impossible.h"
#include "telemetry/sequence_tracker.h"

namespace joulecast::telemetry {
namespace {

// A column that the mapping uses, with its value at the present row.
struct Column {
  std::string name;  // "<table>:<column>" of a joined table
  ValueLimits limits = {};
  CellPlace place = {};
  double value = signals::unmeasured;
  std::optional<signals::HeldReading> held = {};  // of covariates alone
  bool overflows = false;                         // declared or noted
  std::size_t joined = SIZE_MAX;                  // the table in which it is; SIZE_MAX: the main one
  struct Reading {
    std::int64_t utime_us = 0;
    double value = 0;
  };
  std::vector<Reading> readings = {};  // of a joined table, by time; of one time the last is valid
};

struct Joined {
  const JoinedTable* table = nullptr;
  JoinReport report;
  std::vector<std::int64_t> lags_us = {};
};

// A row of the main table, to be read in the order of time.
struct RowPlace {
  CsvTable::Place place;
  std::int64_t since_zero_us = 0;
  std::size_t part = 0;
  bool early = false;  // before a row that is before it in the table
};

// Lines at which the time jumps so that a new mission begins.
struct Restarts {
  std::size_t count = 0, last_line = 0;
  std::string_view direction;
};

// Rows of the main table that belong to one mission.
struct Part {
  std::string mission;  // by the mission's column
  double step_s = 0;    // begins since the clock is set by this
};

// With the source's name and folder and the mission for their places in a text.
std::string filled(std::string text, const std::string& source_name, const std::string& mission) {
  const std::filesystem::path path(source_name);
  const std::pair<std::string_view, std::string> places[] = {
      {"{stem}", path.stem().string()},
      {"{folder}", path.parent_path().filename().string()},
      {"{mission}", mission}};
  for (const auto& [place, name] : places)
    if (const auto at = text.find(place); at != std::string::npos) text.replace(at, place.size(), name);
  return text;
}

std::string_view line_of(const RowPlace& row) {
  return row.place.text.substr(0, row.place.text.find_first_of("\r\n"));
}

// Where the clock of rows in the table's order is set or starts again: from there on rows lie between earlier
// ones, far before them, or so far behind that no robot is on one mission. A late row fills a hole, and rows
// without order go back often.
std::vector<std::size_t> restarts_of(std::span<const RowPlace> rows) {
  constexpr std::size_t often = 4;  // a clock that starts again goes back in one of so many steps at most
  std::vector<std::int64_t> steps_us;
  std::vector<std::size_t> steps, restarts;  // back, or far forward
  for (std::size_t k = 1; k < rows.size(); ++k) {
    const std::int64_t step_us = rows[k].since_zero_us - rows[k - 1].since_zero_us;
    steps_us.push_back(std::abs(step_us));
    if (step_us < 0 || step_us > forward_jump_us) steps.push_back(k);
  }
  if (steps.empty() || steps.size() * often >= rows.size()) return {};
  const std::int64_t usual_us = upper_median(std::move(steps_us));
  std::map<std::int64_t, std::string_view> seen;  // lines of the mission
  std::size_t next = 0;
  for (const std::size_t k : steps) {
    for (; next < k; ++next) seen.emplace(rows[next].since_zero_us, line_of(rows[next]));
    // The following rows in ascending order within the time range of the earlier ones.
    std::size_t end = k + 1;
    while (end < rows.size() && rows[end].since_zero_us >= rows[end - 1].since_zero_us &&
           rows[end].since_zero_us <= seen.rbegin()->first)
      ++end;
    const std::int64_t last_us = rows[end - 1].since_zero_us;
    const auto between = seen.upper_bound(rows[k].since_zero_us);
    const bool repeated = std::ranges::all_of(rows.subspan(k, end - k), [&](const RowPlace& row) {
      const auto same = seen.find(row.since_zero_us);
      return same != seen.end() && same->second == line_of(row);
    });
    // Rows lie between earlier ones, or far before them.
    const bool forward = rows[k].since_zero_us > rows[k - 1].since_zero_us;
    if (!forward && (repeated || between == seen.end())) continue;
    if (!forward && between->first >= last_us && between->first - last_us <= 3 * usual_us) continue;
    restarts.push_back(k);
    seen.clear();
  }
  return restarts;
}

// Takes jumps out of positions at times in seconds.
std::vector<double> take_jumps(std::vector<double>& position, const std::vector<double>& time_s) {
  // A jump changes the rate twice, there and back. Turning wheels with encoder steps change it by at most:
  constexpr double times = 8, of_changes = 0.9;  // quantile of those that are not 0; see csv_import_test
  std::vector<std::size_t> read;
  for (std::size_t k = 0; k < position.size(); ++k)
    if (!std::isnan(position[k])) read.push_back(k);
  std::vector<double> rate(read.size()), changes, jumps;
  for (std::size_t k = 1; k < read.size(); ++k) {
    rate[k] = (position[read[k]] - position[read[k - 1]]) / (time_s[read[k]] - time_s[read[k - 1]]);
    if (k > 1 && rate[k] != rate[k - 1]) changes.push_back(std::abs(rate[k] - rate[k - 1]));
  }
  if (changes.empty()) return {};
  const auto usual_change =
      changes.begin() + std::llround(of_changes * static_cast<double>(changes.size() - 1));
  std::ranges::nth_element(changes, usual_change);
  double shift = 0;
  for (std::size_t k = 1; k < read.size(); ++k) {
    const bool inner = k > 1 && k + 1 < read.size();
    const double there = inner ? rate[k] - rate[k - 1] : 0, back = inner ? rate[k] - rate[k + 1] : 0;
    if (std::min(std::abs(there), std::abs(back)) > times * *usual_change && there * back > 0) {
      rate[k] = rate[k - 1];
      jumps.push_back(there * (time_s[read[k]] - time_s[read[k - 1]]));
      shift -= jumps.back();
    }
    position[read[k]] += shift;
  }
  return jumps;
}

// The period of positions that leap back by more than half of their range, as angles do; 0 of others.
double period_of(const std::vector<signals::Sample>& samples, std::size_t number) {
  std::vector<double> steps, periods;
  for (const signals::Sample& sample : samples)
    if (const double position = *signals::numbers_of(sample)[number]; !std::isnan(position))
      steps.push_back(position);
  if (steps.empty()) return 0;
  const auto [low, high] = std::ranges::minmax(steps);
  std::adjacent_difference(steps.begin(), steps.end(), steps.begin());
  // As far as the leap and the step before it, which go different ways.
  for (std::size_t k = 2; k < steps.size(); ++k)
    if (2 * std::abs(steps[k]) > high - low) periods.push_back(std::abs(steps[k] - steps[k - 1]));
  // Such leaps are few; a wheel that turns fast between rows steps by any amount.
  return periods.empty() || 3 * periods.size() >= steps.size() ? 0 : upper_median(std::move(periods));
}

// Puts the rate of a number in its place, over a window. Two samples at least; where fewer than two are
// measured within the window there is no rate. Returns the thrown jumps: of a position that jumps between two
// samples, in which the rate is many times farther from that before and that behind than rates change
// elsewhere. Jumps are taken out.
std::vector<double> differentiate(std::vector<signals::Sample>& samples, std::size_t number,
                                  double window_s) {
  std::vector<double> position, time_s;
  for (const signals::Sample& sample : samples) {
    position.push_back(*signals::numbers_of(sample)[number]);
    time_s.push_back(1e-6 * static_cast<double>(sample.utime_us - samples.front().utime_us));
  }
  std::vector<double> thrown = take_jumps(position, time_s);
  std::size_t begin = 0, end = 0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    while (time_s[k] - time_s[begin] > window_s / 2) ++begin;
    while (end < samples.size() && time_s[end] - time_s[k] <= window_s / 2) ++end;
    // The neighbours at least.
    const std::size_t behind = std::max(end, std::min(k + 2, samples.size()));
    double n = 0, t = 0, y = 0, tt = 0, ty = 0;
    for (std::size_t j = std::min(begin, k == 0 ? 0 : k - 1); j < behind; ++j) {
      if (std::isnan(position[j])) continue;
      const double dt = time_s[j] - time_s[k];
      n += 1, t += dt, y += position[j], tt += dt * dt, ty += dt * position[j];
    }
    const double spread = n * tt - t * t;
    *signals::numbers_of(samples[k])[number] = spread > 0 ? (n * ty - t * y) / spread : signals::unmeasured;
  }
  return thrown;
}

// In a table of changes: repeats each sample until just before the next one, once in the usual interval of
// the rows or in a second, whichever is longer. Returns how many were added.
std::size_t hold_between(std::vector<signals::Sample>& samples) {
  std::vector<std::int64_t> intervals_us;
  for (std::size_t k = 1; k < samples.size(); ++k)
    intervals_us.push_back(samples[k].utime_us - samples[k - 1].utime_us);
  if (intervals_us.empty()) return 0;
  const std::int64_t period_us = upper_median(std::move(intervals_us));
  std::vector<signals::Sample> held;
  for (const signals::Sample& sample : samples) {
    const std::int64_t last_us = sample.utime_us - period_us;
    while (!held.empty() && held.back().utime_us < last_us) {
      held.push_back(held.back());
      std::int64_t& utime_us = held.back().utime_us;
      utime_us = std::min(utime_us + std::max<std::int64_t>(period_us, 1'000'000), last_us);
    }
    held.push_back(sample);
  }
  const std::size_t added = held.size() - samples.size();
  samples = std::move(held);
  return added;
}

class Importer {
 public:
  Importer(ImportTable table, const ImportMapping& mapping, const ImportOptions& options)
      : table_(std::move(table)), mapping_(mapping), options_(options) {}

  Result<std::vector<Import>> run() {
    TRY(bind());
    TRY_ASSIGN(const auto rows, rows_in_order());
    for (const RowPlace& row : rows) {
      table_.go_to(row.place);
      TRY(table_.next());
      TRY(take_row(row));
    }
    TRY(close_mission());
    // Rows behind the last mission, if any.
    if (result_.empty()) result_.emplace_back();
    ImportReport &last = result_.back().report, &first = result_.front().report;
    last.rows += open_.report.rows;
    last.rows_unsorted += open_.report.rows_unsorted;
    last.rows_without_motion += open_.report.rows_without_motion;
    TRY(check_loss());
    if (!repeats_ && !mapping_.rows_on_change && first.cells_filled > first.rows / 2)
      notes_.push_back(
          R"(no reading repeats the one before: if rows are written on change only, "rows": "on_change")"
          " holds them between the rows");
    for (const auto& [count, last_line, direction] : restarts_)
      if (count > 1)
        notes_.push_back(
            fmt::format("the time goes {} at {} lines, the last one line {}", direction, count, last_line));
    for (const ImportTarget& target : mapping_.targets)
      if (has_no_value(target.number)) notes_.push_back("no row has a value of " + target.name);
    first.settings_detected = table_.settings().size();
    for (const auto& notes : {table_.settings(), table_.notes(), notes_})
      first.notes.insert(first.notes.end(), notes.begin(), notes.end());
    for (Joined& joined : joined_) {
      if (!joined.lags_us.empty())
        joined.report.median_lag_s = 1e-6 * static_cast<double>(upper_median(std::move(joined.lags_us)));
      first.joins.push_back(std::move(joined.report));
    }
    std::ranges::stable_sort(result_, {},
                             [](const Import& one) { return one.recording.samples.front().utime_us; });
    return std::move(result_);
  }

 private:
  Result<void> bind(FieldExpression& expression) {
    for (auto* terms : {&expression.terms, &expression.over, &expression.sign_from})
      for (ColumnTerm& term : *terms) {
        const auto known = std::ranges::find(columns_, term.column, &Column::name);
        term.index = static_cast<std::size_t>(known - columns_.begin());
        if (known != columns_.end()) continue;
        Column column{term.column};
        if (const auto limits = mapping_.column_limits.find(term.column);
            limits != mapping_.column_limits.end())
          column.limits = limits->second;
        const std::size_t colon = term.column.find(':');
        const auto joined =
            std::ranges::find(mapping_.joined, term.column.substr(0, colon), &JoinedTable::name);
        if (colon != std::string::npos && joined != mapping_.joined.end()) {
          column.joined = static_cast<std::size_t>(joined - mapping_.joined.begin());
        } else {
          TRY_ASSIGN(column.place, table_.find(term.column));
        }
        columns_.push_back(std::move(column));
      }
    if (expression.wraps_at)
      for (const ColumnTerm& term : expression.terms) columns_[term.index].overflows = true;
    return {};
  }

  Result<void> bind() {
    if (!mapping_.mission_column.empty()) {
      TRY_ASSIGN(mission_place_, table_.find(mapping_.mission_column));
    }
    for (const auto& [column, wanted] : mapping_.require) {
      TRY_ASSIGN(const auto place, table_.find(column));
      required_.push_back(place);
    }
    for (ImportTarget& target : mapping_.targets) TRY(bind(target.expression));
    const std::size_t of_targets = columns_.size();
    for (ImportTarget& target : mapping_.covariates) TRY(bind(target.expression));
    for (Column& column : std::span(columns_).subspan(of_targets)) column.held.emplace();
    for (const auto& [column, limits] : mapping_.column_limits)
      if (std::ranges::find(columns_, column, &Column::name) == columns_.end())
        return invalid("/column_limits/" + column, "no field and no covariate uses this column");
    for (const JoinedTable& table : mapping_.joined) {
      joined_.push_back({&table, {.table = table.name}});
      TRY(read_joined(joined_.size() - 1));
    }
    return {};
  }

  // Reads a joined table; empty cells and values outside the limits, which are glitches, give no reading.
  Result<void> read_joined(std::size_t index) {
    const std::string& name = joined_[index].table->name;
    JoinReport& report = joined_[index].report;
    std::vector<Column*> columns;
    for (Column& column : columns_)
      if (column.joined == index) columns.push_back(&column);
    if (columns.empty()) return {};
    if (!options_.read_file) return invalid("/tables/" + name, "is a file, and no file can be read");
    const auto folder = std::filesystem::path(options_.source_name).parent_path();
    const std::string file = filled(joined_[index].table->file, options_.source_name, "{mission}");
    TRY_ASSIGN(const auto text, options_.read_file((folder / file).string()));
    TRY_ASSIGN(auto table,
               ImportTable::open(text, joined_[index].table->layout, options_.source_name + " with " + name));
    const auto own_name = [&](const Column* column) { return column->name.substr(name.size() + 1); };
    for (Column* column : columns) {
      TRY_ASSIGN(column->place, table.find(own_name(column)));
    }
    const auto read_cells = [&](std::int64_t utime_us) -> Result<void> {
      for (Column* column : columns) {
        TRY_ASSIGN(const auto value, table.number(column->place, own_name(column)));
        if (value && !std::isnan(*value) && within_limits(*column, *value, table.line()))
          column->readings.push_back({utime_us, *value});
      }
      return {};
    };
    while (true) {
      TRY_ASSIGN(const auto utime_us, table.next_time());
      if (!utime_us) break;
      if (auto taken = read_cells(*utime_us); !taken) {
        if (!table.pass_damaged(true)) return taken;
        continue;
      }
      ++report.rows;
    }
    for (Column* column : columns) std::ranges::stable_sort(column->readings, {}, &Column::Reading::utime_us);
    return {};
  }

  // The rows of each mission by time.
  Result<std::vector<RowPlace>> rows_in_order() {
    std::vector<RowPlace> rows;
    std::size_t outside = 0;
    bool dated = false;
    while (true) {
      TRY_ASSIGN(const auto since_zero_us, table_.next_time());
      if (!since_zero_us) break;
      if (parts_.empty()) parts_.emplace_back();
      if (!mapping_.mission_column.empty()) {
        std::string text(table_.text(mission_place_));
        for (char& c : text)
          if (!signals::is_valid_mission_id(std::string_view(&c, 1))) c = '_';
        if ((!text.empty() || !mapping_.hold_empty_cells) && text != parts_.back().mission)
          parts_.push_back({text});
        if (parts_.back().mission.empty()) {
          ++outside;
          continue;
        }
      }
      dated = dated || *since_zero_us >= year_2000_utime_us;
      rows.push_back({table_.place(), *since_zero_us, parts_.size() - 1});
    }
    if (outside > 0) notes_.push_back(fmt::format("{} rows belong to no mission", outside));
    const std::size_t all = rows.size();
    if (dated)
      std::erase_if(rows, [](const RowPlace& row) { return row.since_zero_us < year_2000_utime_us; });
    if (2 * rows.size() < all)
      return fail(Fault::corrupt, options_.source_name,
                  fmt::format("{} of {} rows are of a clock that is not set: split the table",
                              all - rows.size(), all));
    if (rows.size() < all)
      notes_.push_back(fmt::format("{} rows of a clock that is not set are left out", all - rows.size()));
    divide_at_restarts(rows);
    std::ranges::stable_sort(rows, {},
                             [](const RowPlace& row) { return std::pair(row.part, row.since_zero_us); });
    return rows;
  }

  void divide_at_restarts(std::vector<RowPlace>& rows) {
    std::vector<Part> parts;
    for (auto begin = rows.begin(); begin != rows.end();) {
      const std::size_t part = begin->part;
      const auto end = std::find_if(begin, rows.end(), [&](const RowPlace& row) { return row.part != part; });
      const std::span<RowPlace> run(begin, end);
      const auto restarts = restarts_of(run);
      std::int64_t newest_us = INT64_MIN;
      parts.push_back({parts_[part].mission});
      for (std::size_t k = 0; k < run.size(); ++k) {
        if (std::ranges::binary_search(restarts, k)) {
          const auto step_us = run[k].since_zero_us - run[k - 1].since_zero_us;
          parts.push_back({parts_[part].mission, 1e-6 * static_cast<double>(step_us)});
          newest_us = INT64_MIN;
        }
        run[k].part = parts.size() - 1;
        run[k].early = run[k].since_zero_us < newest_us;
        newest_us = std::max(newest_us, run[k].since_zero_us);
      }
      begin = end;
    }
    parts_ = std::move(parts);
  }

  Result<std::int64_t> time_of(const RowPlace& row) {
    const bool first = !shift_us_;
    if (first)
      shift_us_ = options_.start_utime_us
                      ? std::min(*options_.start_utime_us, latest_import_utime_us + 1) - row.since_zero_us
                      : 0;
    const std::int64_t utime_us = row.since_zero_us + *shift_us_;
    if (utime_us < 0 || utime_us > latest_import_utime_us)
      return table_.refuse(mapping_.layout.time_name(), utc_text(utime_us),
                           "is not between the years 1970 and 2100");
    // Tables of one recording count from one zero.
    if (first)
      for (Column& joined : columns_)
        for (Column::Reading& reading : joined.readings) reading.utime_us += *shift_us_;
    return utime_us;
  }

  // Whether a reading is within its column's limits; others are glitches.
  bool within_limits(const Column& column, double value, std::size_t line) {
    if (column.limits.contain(value)) return true;
    open_.report.glitches.push_back({line, column.name, value, column.limits.holds ? "hold" : "unmeasured"});
    return false;
  }

  // The first leap of a column by nearly all of a counter's range.
  void note_overflow(Column& column, double value) {
    constexpr double nearly = 0.75;
    const double leap = std::abs(value - column.value);
    for (const double range : {0x1p16, 0x1p32})
      if (leap > nearly * range && leap <= range && !std::exchange(column.overflows, true))
        notes_.push_back(fmt::format(
            R"(line {}: column '{}' jumps by {:.10g}; "wraps_at": {:.10g} corrects a counter that overflows)",
            table_.line(), column.name, leap, range));
  }

  Result<void> take_cells(std::int64_t utime_us) {
    for (Column& column : columns_) {
      if (column.joined != SIZE_MAX) continue;
      TRY_ASSIGN(const auto value, table_.number(column.place, column.name));
      if (!value && mapping_.hold_empty_cells) {
        open_.report.cells_filled += !std::isnan(column.value);
      } else if (!value) {
        column.value = column.held ? column.held->take(utime_us, signals::unmeasured) : signals::unmeasured;
      } else {
        repeats_ = repeats_ || *value == column.value;
        note_overflow(column, *value);
        if (std::isnan(*value) || within_limits(column, *value, table_.line()))
          column.value = *value;
        else if (!column.limits.holds)
          column.value = signals::unmeasured;
        if (column.held) column.held->take(utime_us, column.value);
      }
    }
    return {};
  }

  // Reads every column of the joined tables at the row's time.
  void take_joined(std::int64_t utime_us) {
    for (std::size_t k = 0; k < joined_.size(); ++k) {
      Joined& joined = joined_[k];
      const std::int64_t tolerance_us = std::llround(1e6 * joined.table->tolerance_s);
      std::int64_t lag_us = 0;
      bool used = false, all = true;
      for (Column& column : columns_) {
        if (column.joined != k) continue;
        used = true;
        const auto& readings = column.readings;
        const auto next = std::ranges::upper_bound(readings, utime_us, {}, &Column::Reading::utime_us);
        const std::int64_t age_us = next == readings.begin() ? INT64_MAX : utime_us - (next - 1)->utime_us;
        column.value = age_us <= tolerance_us ? (next - 1)->value : signals::unmeasured;
        all = all && age_us <= tolerance_us;
        lag_us = std::max(lag_us, age_us);
      }
      if (!used) continue;
      joined.report.matched += all;
      joined.report.beyond_tolerance += !all;
      if (all) joined.lags_us.push_back(lag_us);
    }
  }

  double evaluate(FieldExpression& expression) const {
    using enum FieldExpression::Combine;
    const auto value_of = [&](const ColumnTerm& term) { return term.scale * columns_[term.index].value; };
    const auto& terms = expression.terms;
    double value = expression.combine == constant ? expression.constant : 0;
    if (expression.combine == quaternion_yaw) {
      const double x = value_of(terms[0]), y = value_of(terms[1]);
      const double z = value_of(terms[2]), w = value_of(terms[3]);
      value = std::atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z));
    } else {
      for (const ColumnTerm& term : terms) value += value_of(term);
    }
    if (expression.combine == mean) value /= static_cast<double>(terms.size());
    for (const ColumnTerm& divisor : expression.over) value /= value_of(divisor);
    if (!std::isfinite(value)) value = signals::unmeasured;  // a quotient by 0 is no value
    if (expression.wraps_at) value = expression.unwrapped(value, *expression.wraps_at);
    for (const ColumnTerm& reference : expression.sign_from) {
      const double sign = value_of(reference);
      if (sign < 0) value = -value;
      if (sign > 0 || sign < 0) break;
    }
    return value * expression.scale / expression.divide_by + 0;  // no negative 0
  }

  Result<Recording> name_recording(const std::string& mission) {
    Recording recording;
    recording.robot_id = options_.robot_id.value_or(mapping_.robot_id);
    if (!signals::is_valid_robot_id(recording.robot_id))
      return invalid("robot_id", "'" + recording.robot_id + "' is no robot id");
    recording.mission_id =
        filled(options_.mission_id.value_or(mapping_.mission_id), options_.source_name, mission);
    // The id of a mission names one.
    if (const std::size_t number = ++missions_called_[recording.mission_id]; number > 1)
      recording.mission_id += fmt::format("-{}", number);
    if (!signals::is_valid_mission_id(recording.mission_id))
      return invalid("mission_id", fmt::format("'{}' must be 1 to {} of letters, digits, '.', '_', '-'",
                                               recording.mission_id, signals::max_mission_id_length));
    recording.payload_kg = mapping_.payload_kg;
    return recording;
  }

  // Where the row's mission is another than the one before, that one is complete.
  Result<void> take_part(const RowPlace& row) {
    if (row.part == part_) return {};
    const auto& samples = open_.recording.samples;
    const std::int64_t last_us = samples.empty() ? 0 : samples.back().utime_us;
    TRY(close_mission());
    part_ = row.part;
    const double step_s = parts_[part_].step_s;
    if (step_s == 0) return {};
    auto& [count, last_line, direction] = restarts_[step_s < 0 ? 0 : 1];
    last_line = table_.line();
    if (count++ == 0)
      notes_.push_back(fmt::format("line {}: the time goes {} by {:.10g} s: a new mission begins{}",
                                   last_line, direction, std::abs(step_s),
                                   step_s > 0 ? ""
                                   : mapping_.layout.time_unit_ns > 0
                                       ? R"(; set "wraps_at" for a time that overflows)"
                                       : R"(; name the zone in "utc_offset" if its clocks change)"));
    // Rows without a date go on after the mission before.
    if (options_.start_utime_us && last_us > 0 && step_s < 0)
      shift_us_ = last_us + options_.pause_us - row.since_zero_us;
    return {};
  }

  Result<void> take_row(const RowPlace& row) {
    for (auto place = required_.begin(); const auto& [column, wanted] : mapping_.require)
      if (const std::string_view text = table_.text(*place++); !text.empty() && text != wanted)
        return table_.refuse(column, text, "where this mapping requires '" + wanted + "'");
    TRY(take_part(row));
    TRY_ASSIGN(auto utime_us, time_of(row));
    if (auto taken = take_cells(utime_us); !taken) {
      if (table_.pass_damaged(true)) return {};
      return taken;
    }
    std::vector<signals::Sample>& samples = open_.recording.samples;
    ImportReport& report = open_.report;
    ++report.rows;
    report.rows_unsorted += row.early;
    take_joined(utime_us);

    signals::Sample sample;
    sample.utime_us = utime_us;
    sample.payload_kg = mapping_.payload_kg;
    const auto numbers = signals::numbers_of(sample);
    for (auto& [name, expression, number] : mapping_.targets) *numbers[number] = evaluate(expression);
    std::vector<double> covariates;
    for (auto& [name, expression, number] : mapping_.covariates) covariates.push_back(evaluate(expression));
    if (lacks_motion(sample)) {
      ++report.rows_without_motion;
    } else if (!samples.empty() && utime_us <= samples.back().utime_us) {
      ++report.rows_out_of_time;
    } else {
      samples.push_back(sample);
      open_.recording.covariates.resize(covariates.size());
      for (std::size_t k = 0; k < covariates.size(); ++k) {
        signals::CovariateSeries& series = open_.recording.covariates[k];
        series.name = mapping_.covariates[k].name;
        const double last = series.value.empty() ? signals::unmeasured : series.value.back();
        if (signals::same(last, covariates[k])) continue;
        series.utime_us.push_back(utime_us);
        series.value.push_back(covariates[k]);
      }
    }
    return {};
  }

  // Angles of a wheel within one turn leap back by it; leaps of other positions are noted.
  void undo_turns(std::vector<signals::Sample>& samples, const ImportTarget& target) {
    constexpr double turn_rad = 2 * std::numbers::pi, unsure = 0.05;  // by the change of the speed
    const double period = period_of(samples, target.number);
    if (period == 0) return;
    const bool turns = std::abs(period / turn_rad - 1) < unsure && target.name.starts_with("wheel_");
    Unwrapped unwrapped;
    for (signals::Sample& sample : samples) {
      double& position = *signals::numbers_of(sample)[target.number];
      if (turns) position = unwrapped(position, turn_rad);
    }
    notes_.push_back(
        turns ? fmt::format("{}: positions jump back by a turn and are unwrapped", target.name)
              : fmt::format(R"({}: positions jump by {:.6g}; "wraps_at" corrects a counter that overflows)",
                            target.name, period));
  }

  bool has_no_value(std::size_t number) {
    return std::ranges::all_of(result_, [&](Import& one) {
      return std::ranges::all_of(one.recording.samples, [&](signals::Sample& sample) {
        return std::isnan(*signals::numbers_of(sample)[number]);
      });
    });
  }

  // Computes rates, and drops samples left without motion.
  Result<void> close_mission() {
    std::vector<signals::Sample>& samples = open_.recording.samples;
    if (samples.empty()) return {};  // its rows count with the next one's
    TRY_ASSIGN(auto named, name_recording(parts_[part_].mission));
    for (const ImportTarget& target : mapping_.targets) {
      if (!target.expression.rate_window_s) continue;
      undo_turns(samples, target);
      for (const double jump : differentiate(samples, target.number, *target.expression.rate_window_s))
        open_.report.glitches.push_back({0, target.name, jump, "outlier of the position: removed"});
    }
    open_.report.rows_without_motion += std::erase_if(samples, lacks_motion);
    if (mapping_.rows_on_change) open_.report.samples_added = hold_between(samples);
    open_.report.samples = samples.size();
    for (std::size_t k = 0; k < samples.size(); ++k) samples[k].sequence = static_cast<std::int64_t>(k);
    named.samples = std::move(samples);
    named.covariates = std::move(open_.recording.covariates);
    std::erase_if(named.covariates, [](const auto& series) { return series.value.empty(); });
    std::ranges::stable_sort(named.covariates, {}, [](const auto& one) { return one.utime_us.front(); });
    open_.recording = named.samples.empty() ? Recording{} : std::move(named);
    if (!open_.recording.samples.empty()) result_.push_back(std::exchange(open_, Import{}));
    return {};
  }

  // A table in which most rows give no sample is rejected as a mistake.
  Result<void> check_loss() const {
    ImportReport all;
    for (const Import& one : result_) {
      all.rows += one.report.rows;
      all.rows_out_of_time += one.report.rows_out_of_time;
      all.rows_without_motion += one.report.rows_without_motion;
    }
    if (all.rows == 0)
      return fail(Fault::corrupt, options_.source_name, "has no row of numbers below its header");
    const std::size_t lost = all.rows_out_of_time + all.rows_without_motion;
    if (!result_[0].recording.samples.empty() && 2 * lost <= all.rows) return {};
    std::string without;
    for (const Column& column : columns_)
      if (std::isnan(column.value)) without += (without.empty() ? "; no number in '" : "', '") + column.name;
    return fail(
        Fault::corrupt, options_.source_name,
        fmt::format(
            "{} of {} rows of missions would be lost: {} have the time of another row ('{}' has too few "
            "digits; \"columns\" joins seconds and nanoseconds, \"rate_hz\" needs no time), "
            "{} have no speed of both wheels{}",
            lost, all.rows, all.rows_out_of_time, mapping_.layout.time_name(), all.rows_without_motion,
            without.empty() ? "" : without + "'"));
  }

  ImportTable table_;
  ImportMapping mapping_;  // with the state of its expressions
  const ImportOptions& options_;
  std::vector<Column> columns_;
  std::vector<Joined> joined_;
  std::vector<CellPlace> required_;  // in the order of the mapping's
  CellPlace mission_place_;
  std::optional<std::int64_t> shift_us_;
  bool repeats_ = false;  // a reading that is written is the same as the one before
  std::vector<Part> parts_;
  std::size_t part_ = 0;  // that the present row belongs to
  std::array<Restarts, 2> restarts_{{{.direction = "back"}, {.direction = "forward"}}};
  std::map<std::string, std::size_t> missions_called_;
  std::vector<std::string> notes_;
  Import open_;
  std::vector<Import> result_;
};

}  // namespace

Result<std::vector<Import>> import_missions(std::string_view csv, const ImportMapping& mapping,
                                            const ImportOptions& options) {
  TRY_ASSIGN(auto table, ImportTable::open(csv, mapping.layout, options.source_name));
  return Importer(std::move(table), mapping, options).run();
}

}  // namespace joulecast::telemetry
