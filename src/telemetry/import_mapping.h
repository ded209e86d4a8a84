#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "signals/sample.h"
#include "telemetry/csv_import.h"

// What a mapping file says, as data. Only the import's own sources use this.
namespace joulecast::telemetry {

enum class OutsidePolicy {
  hold,     // repeat the column's last good value
  clamp,    // the nearest limit
  blank,    // NaN
  drop_row  // no sample of this row
};

struct ValueLimits {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  OutsidePolicy outside = OutsidePolicy::blank;
};

struct ColumnTerm {
  std::string column;
  bool negate = false;
};

// One number of a sample: combine(terms), then |.|, sign of the first non-zero reference, negation,
// * scale / divide_by + offset, limits.
struct FieldExpression {
  enum class Source { constant, columns, quaternion_yaw };
  Source source = Source::constant;
  double constant = signals::unmeasured;
  std::vector<ColumnTerm> terms;  // of a quaternion: x, y, z, w
  bool mean = false;              // else the sum
  bool absolute = false;
  std::vector<ColumnTerm> sign_from;
  bool negate = false;
  double scale = 1;
  double divide_by = 1;
  double offset = 0;
  std::optional<ValueLimits> limits;
};

struct FieldTarget {
  std::string name;        // of the field, e.g. "wheel_velocity[0]"
  std::size_t number = 0;  // of signals::sample_fields
  FieldExpression expression;
};

struct CovariateTarget {
  std::string name;
  FieldExpression expression;
};

// A column of texts, each of which becomes the label quantity=text.
struct LabelTarget {
  std::string quantity;
  std::string column;
};

struct ImportMapping::Content {
  std::string robot_id;
  std::string mission_id = "{stem}";
  double payload_kg = signals::unmeasured;
  char separator = ',';
  std::string column_prefix;
  std::string time_column;
  std::int64_t time_unit_ns = 1'000'000'000;
  std::int64_t epoch_us = 0;  // robot clock where the time column reads 0
  bool hold_empty_cells = true;
  std::map<std::string, std::string> require;  // every non-empty cell of the column reads exactly this
  std::map<std::string, ValueLimits> column_limits;
  std::vector<FieldTarget> targets;
  std::vector<CovariateTarget> covariates;
  std::vector<LabelTarget> labels;
};

}  // namespace joulecast::telemetry
