#include "telemetry/csv_import.h"

#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <unordered_map>

#include "signals/ids.h"
#include "telemetry/codec.h"
#include "telemetry/csv_table.h"
#include "telemetry/import_covariates.h"
#include "telemetry/import_mapping.h"

namespace joulecast::telemetry {
namespace {

constexpr std::int64_t latest_utime_us = 4'102'444'800'000'000;  // the year 2100

std::string_view name_of(OutsidePolicy policy) noexcept {
  switch (policy) {
    case OutsidePolicy::hold:
      return "hold";
    case OutsidePolicy::clamp:
      return "clamp";
    case OutsidePolicy::blank:
      return "unmeasured";
    case OutsidePolicy::drop_row:
      return "drop_row";
  }
  return "";
}

std::string_view trimmed(std::string_view text) noexcept {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

std::optional<double> parse_number(std::string_view text) noexcept {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// Time since the column's zero in us. Whole numbers stay exact: ns since 1970 do not fit a double.
std::optional<std::int64_t> parse_time_us(std::string_view text, std::int64_t unit_ns) noexcept {
  std::int64_t whole = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), whole);
  if (fault == std::errc{} && end == text.data() + text.size()) {
    if (unit_ns < 1000) return whole / (1000 / unit_ns);
    std::int64_t scaled = 0;
    if (__builtin_mul_overflow(whole, unit_ns / 1000, &scaled)) return std::nullopt;
    return scaled;
  }
  const auto real = parse_number(text);
  if (!real) return std::nullopt;
  const double us = *real * static_cast<double>(unit_ns) / 1000;
  if (!(std::abs(us) <= static_cast<double>(latest_utime_us))) return std::nullopt;
  return std::llround(us);
}

// A column that the mapping uses, with the value it holds at the present row.
struct Column {
  std::string name;
  std::size_t place = 0;
  const ValueLimits* limits = nullptr;
  double value = signals::unmeasured;
};

struct Reference {
  std::size_t column = 0;  // in Importer::columns_
  bool negate = false;
};

struct BoundExpression {
  const FieldExpression* expression = nullptr;
  std::string name;  // of the number it gives, e.g. motor_current[1]
  std::vector<Reference> terms;
  std::vector<Reference> sign_from;
};

struct BoundTarget {
  const FieldTarget* target = nullptr;
  BoundExpression value;
};

struct BoundLabels {
  const LabelTarget* target = nullptr;
  std::size_t place = 0;
};

class Importer {
 public:
  Importer(CsvTable table, const ImportMapping::Content& mapping, const ImportOptions& options)
      : table_(std::move(table)), mapping_(mapping), options_(options) {}

  Result<Import> run();

 private:
  Result<void> bind();
  Result<std::size_t> place_of(const std::string& column) const;
  Result<Reference> bind_term(const ColumnTerm& term);
  Result<BoundExpression> bind_expression(const FieldExpression& expression, std::string name);
  Result<std::vector<Reference>> bind_terms(const std::vector<ColumnTerm>& terms);
  Result<void> check_required(const std::vector<std::string_view>& row) const;
  Result<std::int64_t> time_of(const std::vector<std::string_view>& row);
  Result<void> take_cells(const std::vector<std::string_view>& row);
  Result<void> take_covariates(const std::vector<std::string_view>& row);
  double limited(double value, const ValueLimits& limits, double held, const std::string& name);
  double evaluate(const BoundExpression& bound);
  Result<Recording> name_recording() const;

  [[nodiscard]] tl::unexpected<Error> refuse(const std::string& column, std::string_view text,
                                             const std::string& what) const {
    return fail(Fault::corrupt, options_.source_name + ": line " + std::to_string(table_.line()),
                "column '" + column + "': '" + std::string(text) + "' " + what);
  }
  [[nodiscard]] tl::unexpected<Error> located(Error error) const {
    error.field = options_.source_name + ": " + error.field;
    return tl::unexpected(std::move(error));
  }

  CsvTable table_;
  const ImportMapping::Content& mapping_;
  const ImportOptions& options_;
  std::vector<Column> columns_;
  std::unordered_map<std::string, std::size_t> column_index_;
  std::vector<BoundTarget> targets_;
  std::vector<BoundExpression> covariate_targets_;
  std::vector<BoundLabels> label_targets_;
  ImportedCovariates covariates_;
  std::vector<std::pair<std::size_t, const std::string*>> required_;
  std::size_t time_place_ = 0;
  std::optional<std::int64_t> shift_us_;
  bool drop_row_ = false;
  Import result_;
};

Result<std::size_t> Importer::place_of(const std::string& column) const {
  auto place = table_.find(column);
  if (!place && !mapping_.column_prefix.empty()) place = table_.find(mapping_.column_prefix + column);
  if (!place)
    return fail(Fault::invalid, options_.source_name + ": line 1", "column '" + column + "' is missing");
  return *place;
}

Result<Reference> Importer::bind_term(const ColumnTerm& term) {
  if (const auto known = column_index_.find(term.column); known != column_index_.end()) {
    return Reference{known->second, term.negate};
  }
  auto place = place_of(term.column);
  if (!place) return tl::unexpected(std::move(place.error()));
  Column column{term.column, *place, nullptr, signals::unmeasured};
  if (const auto limits = mapping_.column_limits.find(term.column); limits != mapping_.column_limits.end()) {
    column.limits = &limits->second;
  }
  columns_.push_back(std::move(column));
  column_index_[term.column] = columns_.size() - 1;
  return Reference{columns_.size() - 1, term.negate};
}

Result<std::vector<Reference>> Importer::bind_terms(const std::vector<ColumnTerm>& terms) {
  std::vector<Reference> references;
  for (const ColumnTerm& term : terms) {
    auto reference = bind_term(term);
    if (!reference) return tl::unexpected(std::move(reference.error()));
    references.push_back(*reference);
  }
  return references;
}

Result<BoundExpression> Importer::bind_expression(const FieldExpression& expression, std::string name) {
  auto terms = bind_terms(expression.terms);
  if (!terms) return tl::unexpected(std::move(terms.error()));
  auto signs = bind_terms(expression.sign_from);
  if (!signs) return tl::unexpected(std::move(signs.error()));
  return BoundExpression{&expression, std::move(name), std::move(*terms), std::move(*signs)};
}

Result<void> Importer::bind() {
  auto time_place = place_of(mapping_.time_column);
  if (!time_place) return tl::unexpected(std::move(time_place.error()));
  time_place_ = *time_place;
  for (const auto& [column, wanted] : mapping_.require) {
    auto place = place_of(column);
    if (!place) return tl::unexpected(std::move(place.error()));
    required_.emplace_back(*place, &wanted);
  }
  for (const FieldTarget& target : mapping_.targets) {
    auto bound = bind_expression(target.expression, target.name);
    if (!bound) return tl::unexpected(std::move(bound.error()));
    targets_.push_back({&target, std::move(*bound)});
  }
  for (const CovariateTarget& target : mapping_.covariates) {
    auto bound = bind_expression(target.expression, target.name);
    if (!bound) return tl::unexpected(std::move(bound.error()));
    covariate_targets_.push_back(std::move(*bound));
  }
  for (const LabelTarget& target : mapping_.labels) {
    auto place = place_of(target.column);
    if (!place) return tl::unexpected(std::move(place.error()));
    label_targets_.push_back({&target, *place});
  }
  for (const auto& [column, limits] : mapping_.column_limits) {
    if (!column_index_.contains(column)) {
      return invalid("/column_limits/" + column, "no field and no covariate uses this column");
    }
  }
  return {};
}

Result<void> Importer::check_required(const std::vector<std::string_view>& row) const {
  for (const auto& [place, wanted] : required_) {
    const std::string_view text = trimmed(row[place]);
    if (!text.empty() && text != *wanted) {
      return refuse(table_.header()[place], text, "where this mapping requires '" + *wanted + "'");
    }
  }
  return {};
}

Result<std::int64_t> Importer::time_of(const std::vector<std::string_view>& row) {
  const std::string_view text = trimmed(row[time_place_]);
  const auto since_zero_us = parse_time_us(text, mapping_.time_unit_ns);
  if (!since_zero_us) return refuse(mapping_.time_column, text, "is no time");
  if (!shift_us_) {
    shift_us_ = mapping_.epoch_us;
    if (options_.start_utime_us &&
        __builtin_sub_overflow(*options_.start_utime_us, *since_zero_us, &*shift_us_)) {
      return refuse(mapping_.time_column, text, "is no time");
    }
  }
  std::int64_t utime_us = 0;
  if (__builtin_add_overflow(*since_zero_us, *shift_us_, &utime_us) || utime_us < 0 ||
      utime_us > latest_utime_us) {
    return refuse(mapping_.time_column, text, "is not between the years 1970 and 2100");
  }
  return utime_us;
}

double Importer::limited(double value, const ValueLimits& limits, double held, const std::string& name) {
  if (std::isnan(value) || (value >= limits.low && value <= limits.high)) return value;
  result_.report.glitches.push_back({table_.line(), name, value, std::string(name_of(limits.outside))});
  switch (limits.outside) {
    case OutsidePolicy::hold:
      return held;
    case OutsidePolicy::clamp:
      return value < limits.low ? limits.low : limits.high;
    case OutsidePolicy::blank:
      return signals::unmeasured;
    case OutsidePolicy::drop_row:
      drop_row_ = true;
      return held;
  }
  return signals::unmeasured;
}

Result<void> Importer::take_cells(const std::vector<std::string_view>& row) {
  // Infinities are glitches in any column; a column without limits of its own has these.
  static constexpr ValueLimits finite{std::numeric_limits<double>::lowest(),
                                      std::numeric_limits<double>::max(), OutsidePolicy::blank};
  for (Column& column : columns_) {
    const std::string_view text = trimmed(row[column.place]);
    if (text.empty()) {
      if (!mapping_.hold_empty_cells) {
        column.value = signals::unmeasured;
      } else if (!std::isnan(column.value)) {
        ++result_.report.cells_filled;
      }
      continue;
    }
    const auto value = parse_number(text);
    if (!value) return refuse(column.name, text, "is no number");
    column.value =
        limited(*value, column.limits != nullptr ? *column.limits : finite, column.value, column.name);
  }
  return {};
}

Result<void> Importer::take_covariates(const std::vector<std::string_view>& row) {
  for (const BoundExpression& bound : covariate_targets_) covariates_.set(bound.name, evaluate(bound));
  for (const BoundLabels& bound : label_targets_) {
    const std::string_view text = trimmed(row[bound.place]);
    if (!text.empty()) {
      if (auto set = covariates_.set_label(bound.target->quantity, text); !set)
        return refuse(bound.target->column, text, set.error().message);
    } else if (!mapping_.hold_empty_cells) {
      covariates_.forget_labels(bound.target->quantity);
    }
  }
  return {};
}

double Importer::evaluate(const BoundExpression& bound) {
  const FieldExpression& expression = *bound.expression;
  const auto value_of = [&](const Reference& reference) {
    const double value = columns_[reference.column].value;
    return reference.negate ? -value : value;
  };
  double value = expression.constant;
  if (expression.source == FieldExpression::Source::quaternion_yaw) {
    const double x = value_of(bound.terms[0]);
    const double y = value_of(bound.terms[1]);
    const double z = value_of(bound.terms[2]);
    const double w = value_of(bound.terms[3]);
    value = std::atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z));
  } else if (expression.source == FieldExpression::Source::columns) {
    value = 0;
    for (const Reference& term : bound.terms) value += value_of(term);
    if (expression.mean) value /= static_cast<double>(bound.terms.size());
  }
  if (expression.absolute) value = std::abs(value);
  for (const Reference& reference : bound.sign_from) {
    const double sign = value_of(reference);
    if (sign > 0 || sign < 0) {
      if (sign < 0) value = -value;
      break;
    }
  }
  if (expression.negate) value = -value;
  value = value * expression.scale / expression.divide_by + expression.offset;
  if (!expression.limits) return value;
  return limited(value, *expression.limits, signals::unmeasured, bound.name);
}

Result<Recording> Importer::name_recording() const {
  Recording recording;
  recording.robot_id = options_.robot_id.value_or(mapping_.robot_id);
  if (!signals::is_valid_robot_id(recording.robot_id))
    return invalid("robot_id", "'" + recording.robot_id + "' is no robot id");
  recording.mission_id = options_.mission_id.value_or(mapping_.mission_id);
  const std::filesystem::path path(options_.source_name);
  const std::pair<std::string_view, std::string> places[] = {
      {"{stem}", path.stem().string()}, {"{folder}", path.parent_path().filename().string()}};
  for (const auto& [name, text] : places) {
    if (const auto at = recording.mission_id.find(name); at != std::string::npos) {
      recording.mission_id.replace(at, name.size(), text);
    }
  }
  if (!signals::is_valid_mission_id(recording.mission_id)) {
    return invalid("mission_id", "'" + recording.mission_id + "' must be 1 to " +
                                     std::to_string(signals::max_mission_id_length) +
                                     " of letters, digits, '.', '_', '-'");
  }
  recording.payload_kg = mapping_.payload_kg;
  return recording;
}

Result<Import> Importer::run() {
  auto named = name_recording();
  if (!named) return tl::unexpected(std::move(named.error()));
  result_.recording = std::move(*named);
  if (auto bound = bind(); !bound) return tl::unexpected(std::move(bound.error()));

  std::vector<std::string_view> row;
  std::vector<signals::Sample>& samples = result_.recording.samples;
  ImportReport& report = result_.report;
  while (true) {
    auto read = table_.next(row);
    if (!read) return located(std::move(read.error()));
    if (!*read) break;
    ++report.rows;
    drop_row_ = false;
    if (auto met = check_required(row); !met) return tl::unexpected(std::move(met.error()));
    auto utime_us = time_of(row);
    if (!utime_us) return tl::unexpected(std::move(utime_us.error()));
    if (auto taken = take_cells(row); !taken) return tl::unexpected(std::move(taken.error()));

    signals::Sample sample;
    sample.utime_us = *utime_us;
    sample.sequence = static_cast<std::int64_t>(samples.size());
    sample.payload_kg = mapping_.payload_kg;
    const auto numbers = signals::numbers_of(sample);
    for (const BoundTarget& bound : targets_) *numbers[bound.target->number] = evaluate(bound.value);
    if (auto taken = take_covariates(row); !taken) return tl::unexpected(std::move(taken.error()));
    if (drop_row_) {
      ++report.rows_glitched;
    } else if (std::isnan(sample.wheel_velocity_rad_s[0]) || std::isnan(sample.wheel_velocity_rad_s[1])) {
      ++report.rows_without_motion;
    } else if (!samples.empty() && *utime_us <= samples.back().utime_us) {
      ++report.rows_out_of_time;
    } else {
      samples.push_back(sample);
      covariates_.commit(*utime_us);
    }
  }
  report.samples = samples.size();
  if (samples.empty()) {
    return fail(Fault::corrupt, options_.source_name,
                "none of " + std::to_string(report.rows) + " rows gives a sample");
  }
  auto covariates = covariates_.finish();
  if (!covariates) return located(std::move(covariates.error()));
  result_.recording.covariates = std::move(*covariates);
  return std::move(result_);
}

}  // namespace

Result<Import> import_csv(std::string_view csv, const ImportMapping& mapping, const ImportOptions& options) {
  auto table = CsvTable::open(csv, mapping.content().separator);
  if (!table) {
    Error error = std::move(table.error());
    error.field = options.source_name + ": " + error.field;
    return tl::unexpected(std::move(error));
  }
  return Importer(std::move(*table), mapping.content(), options).run();
}

}  // namespace joulecast::telemetry
