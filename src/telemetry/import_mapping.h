#pragma once

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
#include "telemetry/csv_table.h"

// The content of a mapping file, as data. Only the import's own sources use this.
namespace joulecast::telemetry {

// A reading outside repeats the column's last good value where it holds, else it is none.
struct ValueLimits {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool holds = false;
};

struct ColumnTerm {
  std::string column;  // "<table>:<column>" of a joined table
  double scale = 1;    // negation among it
};

enum class Combine { sum, mean, product };

// A position becomes a speed: the slope of a straight line through the readings of a window about each
// sample, its neighbours at least.
struct RateOf {
  double window_s = 0;
};

// One number of a sample: combine(terms) / product(over), wraps undone, then sign of the first non-zero
// reference, negation, * scale / divide_by, rate.
struct FieldExpression {
  enum class Source { constant, columns, quaternion_yaw };
  Source source = Source::constant;
  double constant = signals::unmeasured;
  std::vector<ColumnTerm> terms;  // of a quaternion: x, y, z, w
  Combine combine = Combine::sum;
  std::vector<ColumnTerm> over;
  std::optional<double> wraps_at;  // the reading's period: it leaps back by this
  std::vector<ColumnTerm> sign_from;
  bool negate = false;
  double scale = 1;
  double divide_by = 1;
  std::optional<RateOf> rate;
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

// How a table is written and where its time is.
struct TableLayout {
  CsvFormat format{'\0'};
  bool decimal_comma = false;         // where the separator is detected, so is this
  std::vector<std::string> no_value;  // words for it, besides the usual ones
  std::string column_prefix;
  std::vector<ColumnTerm> time_columns;       // summed, or texts joined by blanks; none: rows at rate_hz
  double rate_hz = 0;                         // from the first row on
  std::int64_t time_unit_ns = 1'000'000'000;  // 0: stamps
  std::string time_format;                    // of stamps, strptime's letters; empty: the usual forms
  std::string utc_offset;                     // of stamps that name no zone, see StampReader; empty: refused
  double wraps_at = 0;                        // period of the time column in its unit; 0: it does not wrap
};

// A table with columns that are read at the times of the main one.
struct JoinedTable {
  std::string name;
  std::string file;  // {stem} and {folder} of the main table; relative to the main table's folder
  TableLayout layout;
  double tolerance_s = 1;  // an older reading gives no value
};

struct ImportMapping::Content {
  std::string robot_id;
  std::string mission_id = "{stem}";
  double payload_kg = signals::unmeasured;
  TableLayout layout;
  std::vector<JoinedTable> joined;
  std::string mission_column;  // its text names the mission; empty: one a table
  bool hold_empty_cells = true;
  bool rows_on_change = false;                 // between rows all readings hold
  std::map<std::string, std::string> require;  // every non-empty cell of the column reads exactly this
  std::map<std::string, ValueLimits> column_limits;
  std::vector<FieldTarget> targets;
  std::vector<CovariateTarget> covariates;
  std::vector<LabelTarget> labels;
};

}  // namespace joulecast::telemetry
