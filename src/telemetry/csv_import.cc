#include "telemetry/csv_import.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <span>
#include <string>
#include <unordered_map>

#include "base/try.h"
#include "signals/ids.h"
#include "telemetry/codec.h"
#include "telemetry/import_covariates.h"
#include "telemetry/import_mapping.h"
#include "telemetry/import_samples.h"
#include "telemetry/import_table.h"

namespace joulecast::telemetry {
namespace {

constexpr std::size_t main_table = SIZE_MAX;
// Infinities are glitches in any column; a column without limits of its own has these.
constexpr ValueLimits finite{std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()};

// A column that the mapping uses, with the value it holds at the present row.
struct Column {
  std::string name;
  CellPlace place;  // in the main table, or the column of the joined one
  const ValueLimits* limits = &finite;
  double value = signals::unmeasured;
  std::size_t series = main_table;  // read at the row's time from there
};

// A column of a joined table, and its readings in the order of time; of one time the last holds.
struct SeriesColumn {
  std::string name;  // in its table
  const ValueLimits* limits = nullptr;
  struct Reading {
    std::int64_t utime_us = 0;
    double value = 0;
  };
  std::vector<Reading> readings = {};
};

struct Reference {
  std::size_t column = 0;  // in Importer::columns_
  double scale = 1;
};

struct Joined {
  const JoinedTable* table = nullptr;
  std::vector<SeriesColumn> columns;
  JoinReport report;
  std::vector<std::int64_t> lags_us;
};

struct BoundExpression {
  const FieldExpression* expression = nullptr;
  std::string name;  // of the number it gives, e.g. motor_current[1]
  std::vector<Reference> terms, over;
  std::vector<Reference> sign_from;
  Unwrapped unwrapped;
};

struct BoundTarget {
  const FieldTarget* target = nullptr;
  BoundExpression value;
};

struct BoundLabels {
  const LabelTarget* target = nullptr;
  CellPlace place;
};

// A row of the main table, to be read in the order of time.
struct RowPlace {
  CsvTable::Place place;
  std::int64_t since_zero_us = 0;
  bool early = false;     // before a row that is before it in the table
  double back_s = 0;      // above 0: a mission begins, since the clock goes back by this
  std::string mission{};  // by the mission's column
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

// Where the clock of rows in the table's order starts again: from there on rows lie between earlier ones, or
// far before them. A late row fills a hole, and rows without order go back often.
void find_restarts(std::span<RowPlace> rows, const ImportTable& table) {
  constexpr std::size_t often = 4;  // a clock that starts again goes back in at most one of this number of
                                    // steps
  std::vector<std::int64_t> steps_us;
  std::size_t back = 0;
  for (std::size_t k = 1; k < rows.size(); ++k) {
    steps_us.push_back(std::abs(rows[k].since_zero_us - rows[k - 1].since_zero_us));
    back += rows[k].since_zero_us < rows[k - 1].since_zero_us;
  }
  if (back == 0 || back * often >= rows.size()) return;
  const auto middle = steps_us.begin() + static_cast<std::ptrdiff_t>(steps_us.size() / 2);
  std::ranges::nth_element(steps_us, middle);
  std::map<std::int64_t, CsvTable::Place> seen;  // of the mission
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const std::int64_t at_us = rows[k].since_zero_us;
    if (!seen.empty() && k > 0 && at_us < rows[k - 1].since_zero_us) {
      // The following rows in ascending order within the time range of the earlier ones.
      std::size_t end = k + 1;
      while (end < rows.size() && rows[end].since_zero_us >= rows[end - 1].since_zero_us &&
             rows[end].since_zero_us <= seen.rbegin()->first)
        ++end;
      const std::int64_t last_us = rows[end - 1].since_zero_us;
      const auto between = seen.upper_bound(at_us);
      const bool repeated = std::all_of(
          rows.begin() + static_cast<std::ptrdiff_t>(k), rows.begin() + static_cast<std::ptrdiff_t>(end),
          [&](const RowPlace& row) {
            const auto same = seen.find(row.since_zero_us);
            return same != seen.end() && table.row_text(same->second) == table.row_text(row.place);
          });
      const bool interleaved = between != seen.end() && between->first < last_us;
      const bool far = between != seen.end() && between->first - last_us > 3 * *middle;
      if (!repeated && (interleaved || far)) {
        rows[k].back_s = 1e-6 * static_cast<double>(rows[k - 1].since_zero_us - at_us);
        seen.clear();
      }
    }
    seen.emplace(at_us, rows[k].place);
  }
}

class Importer {
 public:
  Importer(ImportTable table, const ImportMapping::Content& mapping, const ImportOptions& options)
      : table_(std::move(table)), mapping_(mapping), options_(options) {}

  Result<std::vector<Import>> run();

 private:
  Result<void> bind();
  Result<void> read_joined(Joined& joined, ImportTable table);
  Result<Reference> bind_term(const ColumnTerm& term);
  Result<BoundExpression> bind_expression(const FieldExpression& expression, std::string name);
  Result<std::vector<Reference>> bind_terms(const std::vector<ColumnTerm>& terms);
  Result<std::vector<RowPlace>> rows_in_order();
  Result<void> check_required() const;
  Result<std::int64_t> time_of(const RowPlace& row);
  Result<void> take_cells();
  void take_joined(std::int64_t utime_us);
  Result<void> take_covariates();
  Result<void> take_mission(const RowPlace& row);
  Result<void> take_row(const RowPlace& row);
  double limited(double value, const ValueLimits& limits, const Column& column);
  double combined(const BoundExpression& bound) const;
  double evaluate(BoundExpression& bound);
  Result<Recording> name_recording(const std::string& mission, const std::string& suffix) const;
  Result<void> close_mission();
  void undo_turns(std::vector<signals::Sample>& samples, const FieldTarget& target);
  void finish_samples(Import& mission);
  void report_joins();

  Result<void> check_loss() const;
  void note_overflow(const Column& column, double value);

  ImportTable table_;
  const ImportMapping::Content& mapping_;
  const ImportOptions& options_;
  std::vector<Column> columns_;
  std::vector<Joined> joined_;
  std::unordered_map<std::string, std::size_t> column_index_;
  std::vector<BoundTarget> targets_;
  std::vector<BoundExpression> covariate_targets_;
  std::vector<BoundLabels> label_targets_;
  ImportedCovariates covariates_;
  struct Required {
    const std::string *column, *wanted;
    CellPlace place;
  };
  std::vector<Required> required_;
  CellPlace mission_place_;
  std::optional<std::int64_t> shift_us_;
  std::set<std::string> overflowing_;  // columns that are declared or noted to overflow
  bool repeats_ = false;               // a reading that is written is the same as the one before
  std::string mission_;                // that the present rows belong to; empty where a column is to name it
  std::map<std::string, std::size_t> missions_called_;
  std::vector<std::string> notes_;
  Import open_;
  std::vector<Import> result_;
};

Result<Reference> Importer::bind_term(const ColumnTerm& term) {
  if (const auto known = column_index_.find(term.column); known != column_index_.end())
    return Reference{known->second, term.scale};
  const std::size_t colon = std::min(term.column.find(':'), term.column.size());
  const auto joined = std::ranges::find_if(joined_, [&](const Joined& one) {
    return colon < term.column.size() && one.table->name == std::string_view(term.column).substr(0, colon);
  });
  Column column{term.column, {}};
  if (const auto limits = mapping_.column_limits.find(term.column); limits != mapping_.column_limits.end())
    column.limits = &limits->second;
  if (joined != joined_.end()) {
    column.series = static_cast<std::size_t>(joined - joined_.begin());
    column.place = {joined->columns.size()};
    joined->columns.push_back({term.column.substr(colon + 1), column.limits});
  } else {
    TRY_ASSIGN(column.place, table_.find(term.column));
  }
  columns_.push_back(std::move(column));
  const std::size_t index = columns_.size() - 1;
  column_index_[term.column] = index;
  return Reference{index, term.scale};
}

Result<std::vector<Reference>> Importer::bind_terms(const std::vector<ColumnTerm>& terms) {
  std::vector<Reference> references;
  for (const ColumnTerm& term : terms) {
    TRY_ASSIGN(auto reference, bind_term(term));
    references.push_back(reference);
  }
  return references;
}

Result<BoundExpression> Importer::bind_expression(const FieldExpression& expression, std::string name) {
  TRY_ASSIGN(auto terms, bind_terms(expression.terms));
  TRY_ASSIGN(auto over, bind_terms(expression.over));
  TRY_ASSIGN(auto signs, bind_terms(expression.sign_from));
  return BoundExpression{&expression,     std::move(name),  std::move(terms),
                         std::move(over), std::move(signs), {}};
}

Result<void> Importer::bind() {
  for (const JoinedTable& table : mapping_.joined) {
    joined_.emplace_back().table = &table;
    joined_.back().report.table = table.name;
  }
  if (!mapping_.mission_column.empty()) {
    TRY_ASSIGN(const auto place, table_.find(mapping_.mission_column));
    mission_place_ = place;
  }
  for (const auto& [column, wanted] : mapping_.require) {
    TRY_ASSIGN(auto place, table_.find(column));
    required_.push_back({&column, &wanted, place});
  }
  for (const FieldTarget& target : mapping_.targets) {
    TRY_ASSIGN(auto bound, bind_expression(target.expression, target.name));
    if (target.expression.wraps_at)
      for (const ColumnTerm& term : target.expression.terms) overflowing_.insert(term.column);
    targets_.push_back({&target, std::move(bound)});
  }
  for (const CovariateTarget& target : mapping_.covariates) {
    TRY_ASSIGN(auto bound, bind_expression(target.expression, target.name));
    covariate_targets_.push_back(std::move(bound));
  }
  for (const LabelTarget& target : mapping_.labels) {
    TRY_ASSIGN(auto place, table_.find(target.column));
    label_targets_.push_back({&target, place});
  }
  for (const auto& [column, limits] : mapping_.column_limits)
    if (!column_index_.contains(column))
      return invalid("/column_limits/" + column, "no field and no covariate uses this column");
  for (Joined& joined : joined_) {
    if (joined.columns.empty()) continue;
    const std::string& name = joined.table->name;
    const auto given = options_.joined.find(name);
    if (given == options_.joined.end()) return invalid("/tables/" + name, "the table is not given");
    TRY_ASSIGN(auto table, ImportTable::open(given->second, joined.table->layout,
                                             options_.source_name + " with " + name));
    TRY(read_joined(joined, std::move(table)));
  }
  return {};
}

// Reads a joined table; empty cells and values outside the limits, which are glitches, give no reading.
Result<void> Importer::read_joined(Joined& joined, ImportTable table) {
  std::vector<CellPlace> places;
  for (const SeriesColumn& column : joined.columns) {
    TRY_ASSIGN(const auto place, table.find(column.name));
    places.push_back(place);
  }
  const auto read_cells = [&](std::int64_t utime_us) -> Result<void> {
    for (std::size_t k = 0; k < places.size(); ++k) {
      auto& [name, limits, readings] = joined.columns[k];
      TRY_ASSIGN(const auto value, table.number(places[k], name));
      if (!value || std::isnan(*value)) continue;
      if (std::isfinite(*value) && *value >= limits->low && *value <= limits->high)
        readings.push_back({utime_us, *value});
      else
        open_.report.glitches.push_back(
            {table.line(), joined.table->name + ":" + name, *value, limits->holds ? "hold" : "unmeasured"});
    }
    return {};
  };
  std::int64_t last_us = INT64_MIN;
  while (true) {
    TRY_ASSIGN(const auto utime_us, table.next_time());
    if (!utime_us) break;
    if (auto taken = read_cells(*utime_us); !taken) {
      if (!table.pass_damaged(true)) return taken;
      continue;
    }
    ++joined.report.rows;
    joined.report.rows_unsorted += *utime_us <= last_us;
    last_us = std::max(last_us, *utime_us);
  }
  for (SeriesColumn& column : joined.columns)
    std::ranges::stable_sort(column.readings, {}, &SeriesColumn::Reading::utime_us);
  return {};
}

// The rows of each mission by time.
Result<std::vector<RowPlace>> Importer::rows_in_order() {
  std::vector<RowPlace> rows;
  std::string mission;
  bool dated = false;
  while (true) {
    TRY_ASSIGN(const auto since_zero_us, table_.next_time());
    if (!since_zero_us) break;
    if (!mapping_.mission_column.empty()) {
      const std::string_view text = table_.text(mission_place_);
      if (!text.empty() || !mapping_.hold_empty_cells) mission = text;
    }
    dated = dated || *since_zero_us >= year_2000_utime_us;
    rows.push_back({table_.place(), *since_zero_us, false, 0, mission});
  }
  const std::size_t all = rows.size();
  if (dated) std::erase_if(rows, [](const RowPlace& row) { return row.since_zero_us < year_2000_utime_us; });
  if (2 * rows.size() < all)
    return fail(
        Fault::corrupt, options_.source_name,
        fmt::format("{} of {} rows are of a clock that is not set: split the table", all - rows.size(), all));
  if (rows.size() < all)
    notes_.push_back(fmt::format("{} rows of a clock that is not set are left out", all - rows.size()));
  for (auto begin = rows.begin(); begin != rows.end();) {
    const auto end =
        std::find_if(begin, rows.end(), [&](const RowPlace& row) { return row.mission != begin->mission; });
    find_restarts({begin, end}, table_);
    for (auto from = begin; from != end;) {
      const auto to = std::find_if(from + 1, end, [](const RowPlace& row) { return row.back_s > 0; });
      std::int64_t newest_us = INT64_MIN;
      for (RowPlace& row : std::span(from, to)) {
        row.early = row.since_zero_us < newest_us;
        newest_us = std::max(newest_us, row.since_zero_us);
      }
      const double back_s = std::exchange(from->back_s, 0);
      std::ranges::stable_sort(from, to, {}, &RowPlace::since_zero_us);
      from->back_s = back_s;
      from = to;
    }
    begin = end;
  }
  return rows;
}

Result<void> Importer::check_required() const {
  for (const auto& [column, wanted, place] : required_) {
    const std::string_view text = table_.text(place);
    if (!text.empty() && text != *wanted)
      return table_.refuse(*column, text, "where this mapping requires '" + *wanted + "'");
  }
  return {};
}

Result<std::int64_t> Importer::time_of(const RowPlace& row) {
  const std::string column =
      mapping_.layout.time_columns.empty() ? "time" : mapping_.layout.time_columns[0].column;
  const std::string text = std::to_string(row.since_zero_us) + " us";
  if (!shift_us_) {
    shift_us_ = 0;
    if (options_.start_utime_us) {
      if (__builtin_sub_overflow(*options_.start_utime_us, row.since_zero_us, &*shift_us_))
        return table_.refuse(column, text, "is no time");
      // Tables of one recording count from one zero.
      for (Joined& joined : joined_)
        for (SeriesColumn& series : joined.columns)
          for (SeriesColumn::Reading& reading : series.readings) reading.utime_us += *shift_us_;
    }
  }
  std::int64_t utime_us = 0;
  if (__builtin_add_overflow(row.since_zero_us, *shift_us_, &utime_us) || utime_us < 0 ||
      utime_us > latest_import_utime_us) {
    return table_.refuse(column, text, "is not between the years 1970 and 2100");
  }
  return utime_us;
}

double Importer::limited(double value, const ValueLimits& limits, const Column& column) {
  if (std::isnan(value) || (value >= limits.low && value <= limits.high)) return value;
  open_.report.glitches.push_back({table_.line(), column.name, value, limits.holds ? "hold" : "unmeasured"});
  return limits.holds ? column.value : signals::unmeasured;
}

// The first leap of a column by nearly all of a counter's range.
void Importer::note_overflow(const Column& column, double value) {
  constexpr double sixteen_bits = 65'536, thirty_two_bits = 4'294'967'296;
  constexpr double nearly = 0.75;
  const double leap = std::abs(value - column.value);
  for (const double range : {sixteen_bits, thirty_two_bits})
    if (leap > nearly * range && leap <= range && overflowing_.insert(column.name).second)
      notes_.push_back(fmt::format(
          R"(line {}: column '{}' leaps by {:.10g}; of a counter that overflows "wraps_at": {:.10g} undoes it)",
          table_.line(), column.name, leap, range));
}

Result<void> Importer::take_cells() {
  for (Column& column : columns_) {
    if (column.series != main_table) continue;
    TRY_ASSIGN(const auto value, table_.number(column.place, column.name));
    if (!value) {
      if (!mapping_.hold_empty_cells) {
        column.value = signals::unmeasured;
      } else if (!std::isnan(column.value)) {
        ++open_.report.cells_filled;
      }
      continue;
    }
    repeats_ = repeats_ || *value == column.value;
    note_overflow(column, *value);
    column.value = limited(*value, *column.limits, column);
  }
  return {};
}

Result<void> Importer::take_covariates() {
  for (BoundExpression& bound : covariate_targets_) covariates_.set(bound.name, evaluate(bound));
  for (const BoundLabels& bound : label_targets_) {
    const std::string_view text = table_.text(bound.place);
    if (!text.empty()) {
      if (auto set = covariates_.set_label(bound.target->quantity, text); !set)
        return table_.refuse(bound.target->column, text, set.error().message);
    } else if (!mapping_.hold_empty_cells) {
      covariates_.forget_labels(bound.target->quantity);
    }
  }
  return {};
}

// Reads every column of a series at the row's time.
void Importer::take_joined(std::int64_t utime_us) {
  for (std::size_t k = 0; k < joined_.size(); ++k) {
    Joined& joined = joined_[k];
    if (joined.columns.empty()) continue;
    const std::int64_t tolerance_us = std::llround(1e6 * joined.table->tolerance_s);
    std::int64_t lag_us = 0;
    bool all = true, beyond = false;
    for (Column& column : columns_) {
      if (column.series != k) continue;
      const auto& readings = joined.columns[column.place.column].readings;
      const auto next = std::ranges::upper_bound(readings, utime_us, {}, &SeriesColumn::Reading::utime_us);
      const std::int64_t age_us = next == readings.begin() ? INT64_MAX : utime_us - (next - 1)->utime_us;
      column.value = age_us <= tolerance_us ? (next - 1)->value : signals::unmeasured;
      all = all && age_us <= tolerance_us;
      beyond = beyond || (age_us > tolerance_us && !readings.empty());
      lag_us = std::max(lag_us, age_us);
    }
    joined.report.matched += all;
    joined.report.beyond_tolerance += !all && beyond;
    if (all) joined.lags_us.push_back(lag_us);
  }
}

double Importer::combined(const BoundExpression& bound) const {
  const FieldExpression& expression = *bound.expression;
  const auto value_of = [&](const Reference& reference) {
    return reference.scale * columns_[reference.column].value;
  };
  double value = expression.constant;
  if (expression.source == FieldExpression::Source::quaternion_yaw) {
    const double x = value_of(bound.terms[0]);
    const double y = value_of(bound.terms[1]);
    const double z = value_of(bound.terms[2]);
    const double w = value_of(bound.terms[3]);
    value = std::atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z));
  } else if (expression.source == FieldExpression::Source::columns) {
    const bool product = expression.combine == Combine::product;
    value = product ? 1 : 0;
    for (const Reference& term : bound.terms)
      value = product ? value * value_of(term) : value + value_of(term);
    if (expression.combine == Combine::mean) value /= static_cast<double>(bound.terms.size());
  }
  for (const Reference& divisor : bound.over) value /= value_of(divisor);
  // A quotient by 0 is no value.
  return std::isfinite(value) ? value : signals::unmeasured;
}

double Importer::evaluate(BoundExpression& bound) {
  const FieldExpression& expression = *bound.expression;
  double value = combined(bound);
  if (expression.wraps_at) value = bound.unwrapped(value, *expression.wraps_at);
  for (const Reference& reference : bound.sign_from) {
    const double sign = reference.scale * columns_[reference.column].value;
    if (sign > 0 || sign < 0) {
      if (sign < 0) value = -value;
      break;
    }
  }
  if (expression.negate) value = -value;
  return value * expression.scale / expression.divide_by + 0;  // no negative 0
}

Result<Recording> Importer::name_recording(const std::string& mission, const std::string& suffix) const {
  Recording recording;
  recording.robot_id = options_.robot_id.value_or(mapping_.robot_id);
  if (!signals::is_valid_robot_id(recording.robot_id))
    return invalid("robot_id", "'" + recording.robot_id + "' is no robot id");
  recording.mission_id = options_.mission_id.value_or(mapping_.mission_id);
  if (recording.mission_id.find("{mission}") == std::string::npos) recording.mission_id += suffix;
  recording.mission_id = filled(std::move(recording.mission_id), options_.source_name, mission + suffix);
  if (!signals::is_valid_mission_id(recording.mission_id)) {
    return invalid("mission_id", "'" + recording.mission_id + "' must be 1 to " +
                                     std::to_string(signals::max_mission_id_length) +
                                     " of letters, digits, '.', '_', '-'");
  }
  recording.payload_kg = mapping_.payload_kg;
  return recording;
}

// Where the row's mission is another than the one before, that one is complete.
Result<void> Importer::take_mission(const RowPlace& row) {
  std::string text = row.mission;
  for (char& c : text)
    if (!signals::is_valid_mission_id(std::string_view(&c, 1))) c = '_';
  if (text == mission_ && row.back_s == 0) return {};
  const std::int64_t last_us = open_.recording.samples.empty() ? 0 : open_.recording.samples.back().utime_us;
  TRY(close_mission());
  mission_ = std::move(text);
  if (row.back_s == 0) return {};
  notes_.push_back(fmt::format(
      "line {}: the time goes back by {:.10g} s: a new mission begins{}", table_.line(), row.back_s,
      mapping_.layout.time_unit_ns == 0 ? R"(; a zone in "utc_offset" is for clocks that are set)"
                                        : R"(; "wraps_at" is for a time that wraps)"));
  // Rows without a date go on after the mission before.
  if (options_.start_utime_us && last_us > 0) shift_us_ = last_us + options_.pause_us - row.since_zero_us;
  return {};
}

Result<void> Importer::take_row(const RowPlace& row) {
  TRY(check_required());
  TRY(take_mission(row));
  TRY_ASSIGN(auto utime_us, time_of(row));
  if (auto taken = take_cells(); !taken) {
    if (table_.pass_damaged(true)) return {};
    return taken;
  }
  ++open_.report.rows;
  open_.report.rows_unsorted += row.early;
  take_joined(utime_us);

  std::vector<signals::Sample>& samples = open_.recording.samples;
  ImportReport& report = open_.report;
  signals::Sample sample;
  sample.utime_us = utime_us;
  sample.sequence = static_cast<std::int64_t>(samples.size());
  sample.payload_kg = mapping_.payload_kg;
  const auto numbers = signals::numbers_of(sample);
  for (BoundTarget& bound : targets_) *numbers[bound.target->number] = evaluate(bound.value);
  TRY(take_covariates());
  if (!mapping_.mission_column.empty() && mission_.empty()) {
    ++report.rows_outside_mission;
  } else if (std::isnan(sample.wheel_velocity_rad_s[0]) || std::isnan(sample.wheel_velocity_rad_s[1])) {
    ++report.rows_without_motion;
  } else if (!samples.empty() && utime_us <= samples.back().utime_us) {
    ++report.rows_out_of_time;
  } else {
    samples.push_back(sample);
    covariates_.commit(utime_us);
  }
  return {};
}

// Angles of a wheel within one turn leap back by it; leaps of other positions are noted.
void Importer::undo_turns(std::vector<signals::Sample>& samples, const FieldTarget& target) {
  constexpr double turn_rad = 2 * std::numbers::pi, rounding = 0.01;
  const double leap = leap_of(samples, target.number);
  if (leap == 0) return;
  const bool turns = leap > turn_rad / 2 && leap <= turn_rad + rounding && target.name.starts_with("wheel_");
  Unwrapped unwrapped;
  for (signals::Sample& sample : samples) {
    double& position = *signals::numbers_of(sample)[target.number];
    if (turns) position = unwrapped(position, turn_rad);
  }
  notes_.push_back(
      turns ? fmt::format("{}: its positions leap back by a turn, which is undone", target.name)
            : fmt::format(R"({}: its positions leap through {:.6g}; of a counter "wraps_at" undoes it)",
                          target.name, leap));
}

// Computes rates, and drops samples left without motion.
void Importer::finish_samples(Import& mission) {
  std::vector<signals::Sample>& samples = mission.recording.samples;
  for (const auto& [target, bound] : targets_) {
    const FieldExpression& expression = *bound.expression;
    if (!expression.rate) continue;
    undo_turns(samples, *target);
    for (const ThrownReading& thrown : differentiate(samples, target->number, *expression.rate))
      mission.report.glitches.push_back(
          {0, bound.name, thrown.jump, "thrown reading, a jump of the position: taken out"});
  }
  mission.report.rows_without_motion += std::erase_if(samples, [](const signals::Sample& s) {
    return std::isnan(s.wheel_velocity_rad_s[0]) || std::isnan(s.wheel_velocity_rad_s[1]);
  });
  if (mapping_.rows_on_change) mission.report.samples_added = hold_between(samples);
  mission.report.samples = samples.size();
}

Result<void> Importer::close_mission() {
  if (open_.recording.samples.empty()) return {};  // its rows count with the next one's
  // The id of a mission names one.
  const std::size_t before = missions_called_[mission_]++;
  TRY_ASSIGN(auto named, name_recording(mission_, before > 0 ? "-" + std::to_string(before + 1) : ""));
  auto covariates = covariates_.finish();
  if (!covariates) {
    covariates.error().field = options_.source_name + ": " + covariates.error().field;
    return tl::unexpected(std::move(covariates.error()));
  }
  finish_samples(open_);
  named.samples = std::move(open_.recording.samples);
  named.covariates = std::move(*covariates);
  open_.recording = std::move(named);
  covariates_ = covariates_.next_mission();
  if (!open_.recording.samples.empty()) result_.push_back(std::move(open_));
  open_ = {};
  return {};
}

void Importer::report_joins() {
  for (Joined& joined : joined_) {
    if (!joined.lags_us.empty()) {
      const auto middle = joined.lags_us.begin() + static_cast<std::ptrdiff_t>(joined.lags_us.size() / 2);
      std::ranges::nth_element(joined.lags_us, middle);
      joined.report.median_lag_s = 1e-6 * static_cast<double>(*middle);
      joined.report.greatest_lag_s = 1e-6 * static_cast<double>(std::ranges::max(joined.lags_us));
    }
    result_.front().report.joins.push_back(std::move(joined.report));
  }
}

// A table in which most rows give no sample is rejected as a mistake.
Result<void> Importer::check_loss() const {
  std::size_t rows = 0, same_time = 0, no_motion = 0;
  for (const Import& one : result_) {
    rows += one.report.rows - one.report.rows_outside_mission;
    same_time += one.report.rows_out_of_time;
    no_motion += one.report.rows_without_motion;
  }
  if (2 * (same_time + no_motion) <= rows) return {};
  return fail(
      Fault::corrupt, options_.source_name,
      fmt::format(
          "{} of {} rows would be lost: {} have the time of another row ('{}' has too few digits; "
          "\"columns\" "
          "joins seconds and nanoseconds, \"rate_hz\" needs no time), {} have no speed of both wheels",
          same_time + no_motion, rows, same_time,
          mapping_.layout.time_columns.empty() ? "time" : mapping_.layout.time_columns[0].column, no_motion));
}

Result<std::vector<Import>> Importer::run() {
  if (mapping_.mission_column.empty()) {
    // Reported before any row is read.
    TRY(name_recording("", ""));
  }
  TRY(bind());
  TRY_ASSIGN(const auto rows, rows_in_order());
  for (const RowPlace& row : rows) {
    table_.go_to(row.place);
    TRY(table_.next());
    TRY(take_row(row));
  }
  const ImportReport last = open_.report;
  const bool open = !open_.recording.samples.empty();
  TRY(close_mission());
  if (result_.empty())
    return fail(Fault::corrupt, options_.source_name,
                fmt::format("none of {} rows gives a sample: {} have no wheel speeds, {} no mission",
                            rows.size(), last.rows_without_motion, last.rows_outside_mission));
  if (!open) {
    result_.back().report.rows += last.rows;
    result_.back().report.rows_unsorted += last.rows_unsorted;
    result_.back().report.rows_outside_mission += last.rows_outside_mission;
    result_.back().report.rows_without_motion += last.rows_without_motion;
  }
  TRY(check_loss());
  if (!repeats_ && !mapping_.rows_on_change &&
      result_.front().report.cells_filled > result_.front().report.rows / 2)
    notes_.push_back(
        R"(no reading repeats the one before: where rows are written on change alone, "rows": "on_change")"
        " holds them between the rows");
  for (const auto& notes : {table_.notes(), notes_})
    result_.front().report.notes.insert(result_.front().report.notes.end(), notes.begin(), notes.end());
  report_joins();
  std::ranges::stable_sort(result_, {},
                           [](const Import& one) { return one.recording.samples.front().utime_us; });
  return std::move(result_);
}

}  // namespace

std::vector<JoinedFile> joined_files(const ImportMapping& mapping, const std::string& source_name) {
  const std::filesystem::path folder = std::filesystem::path(source_name).parent_path();
  std::vector<JoinedFile> files;
  for (const JoinedTable& table : mapping.content().joined)
    files.push_back({table.name, (folder / filled(table.file, source_name, "{mission}")).string()});
  return files;
}

Result<std::vector<Import>> import_missions(std::string_view csv, const ImportMapping& mapping,
                                            const ImportOptions& options) {
  TRY_ASSIGN(auto table, ImportTable::open(csv, mapping.content().layout, options.source_name));
  return Importer(std::move(table), mapping.content(), options).run();
}

}  // namespace joulecast::telemetry
