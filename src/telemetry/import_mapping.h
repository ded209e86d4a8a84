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

#include "telemetry/csv_import.h"
#include "telemetry/sample.h"

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
  double constant = unmeasured;
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

// The doubles of a sample that a table can fill, in the order of robot_telemetry_t, and where they go.
struct SampleSlot {
  std::string_view field;  // name in robot_telemetry_t
  std::size_t size = 1;    // elements; 1 is a scalar
  double* (*place)(Sample&) = nullptr;
};

inline constexpr std::array<SampleSlot, 10> sample_slots{{
    {"wheel_velocity", 2, [](Sample& s) { return s.wheel_velocity_rad_s.data(); }},
    {"motor_voltage", 2, [](Sample& s) { return s.motor_voltage_v.data(); }},
    {"motor_current", 2, [](Sample& s) { return s.motor_current_a.data(); }},
    {"battery_voltage", 1, [](Sample& s) { return &s.battery_voltage_v; }},
    {"battery_current", 1, [](Sample& s) { return &s.battery_current_a; }},
    {"velocity_command", 2, [](Sample& s) { return s.velocity_command.data(); }},
    {"yaw_rate", 1, [](Sample& s) { return &s.yaw_rate_rad_s; }},
    {"pitch", 1, [](Sample& s) { return &s.pitch_rad; }},
    {"pose", 3, [](Sample& s) { return s.pose.data(); }},
    {"motor_temperature", 2, [](Sample& s) { return s.motor_temperature_c.data(); }},
}};

struct FieldTarget {
  const SampleSlot* slot = nullptr;
  std::size_t element = 0;
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
  double payload_kg = unmeasured;
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
