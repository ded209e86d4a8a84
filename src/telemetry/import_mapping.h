#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "signals/sample.h"
#include "telemetry/csv_table.h"

// Mapping files; schemas/import-mapping.schema.json describes the members.
namespace joulecast::telemetry {

extern const std::string_view import_mapping_schema;  // its text

// The finite readings between these are taken; any other repeats the column's last good one where it holds,
// else it is none.
struct ValueLimits {
  double low = std::numeric_limits<double>::lowest();
  double high = std::numeric_limits<double>::max();
  bool holds = false;

  bool contain(double value) const { return value >= low && value <= high; }
};

struct ColumnTerm {
  std::string column;     // "<table>:<column>" of a joined table
  double scale = 1;       // negation among it
  std::size_t index = 0;  // of the importer's columns

  bool operator==(const ColumnTerm&) const = default;
};

// Undoes the wraps of a reading that leaps by its period.
class Unwrapped {
 public:
  double operator()(double value, double period);

 private:
  double last_ = signals::unmeasured, shift_ = 0;
};

// One number of a sample: combine(terms) / product(over), wraps undone, then sign of the first non-zero
// reference, * scale / divide_by, rate.
struct FieldExpression {
  enum class Combine { constant, sum, mean, quaternion_yaw };
  Combine combine = Combine::sum;
  double constant = signals::unmeasured;
  std::vector<ColumnTerm> terms;  // of a quaternion: x, y, z, w
  std::vector<ColumnTerm> over, sign_from;
  std::optional<double> wraps_at;  // the reading's period: it leaps back by this
  Unwrapped unwrapped;
  double scale = 1;  // negation among it
  double divide_by = 1;
  // A position becomes a speed: the slope of a straight line through the readings of a window of this width
  // about each sample, its neighbours at least.
  std::optional<double> rate_window_s;
};

// A field or a covariate.
struct ImportTarget {
  std::string name;  // e.g. "wheel_velocity[0]"
  FieldExpression expression;
  std::size_t number = 0;  // of signals::sample_fields
};

// How a table is written and where its time is.
struct TableLayout {
  CsvFormat format{'\0'};
  std::vector<std::string> no_value;  // words for it, besides the usual ones
  std::string column_prefix;
  std::vector<ColumnTerm> time_columns;       // summed, or texts joined by blanks; none: rows at rate_hz
  double rate_hz = 0;                         // from the first row on
  std::int64_t time_unit_ns = 1'000'000'000;  // 0: stamps
  std::string time_format;                    // of stamps, strptime's letters; empty: the usual forms
  std::string utc_offset;                     // of stamps that name no zone, see StampReader; empty: refused
  double wraps_at = 0;                        // period of the time column in its unit; 0: it does not wrap

  std::string time_name() const { return time_columns.empty() ? "time" : time_columns[0].column; }
};

// A table with columns that are read at the times of the main one.
struct JoinedTable {
  std::string name;
  std::string file;  // {stem} and {folder} of the main table; relative to the main table's folder
  TableLayout layout;
  double tolerance_s = 1;  // an older reading gives no value
};

// A mapping file, parsed and checked.
struct ImportMapping {
  // On a fault the error's field is the JSON pointer of the first offending member; the message has all.
  static Result<ImportMapping> parse(std::string_view json);

  std::string robot_id;
  std::string mission_id;
  double payload_kg = signals::unmeasured;
  TableLayout layout;
  std::vector<JoinedTable> joined;
  std::string mission_column;  // its text names the mission; empty: one a table
  bool hold_empty_cells = true;
  bool rows_on_change = false;                 // between rows all readings hold
  std::map<std::string, std::string> require;  // every non-empty cell of the column reads exactly this
  std::map<std::string, ValueLimits> column_limits;
  std::vector<ImportTarget> targets, covariates;
};

// Every fault of a mapping's text, of which parse() makes one error; empty where it has none.
[[nodiscard]] std::vector<FieldFault> mapping_faults(std::string_view text);
// For a usable mapping: parts that are probably mistakes.
[[nodiscard]] std::vector<FieldFault> suspicious(const ImportMapping& mapping);

}  // namespace joulecast::telemetry
