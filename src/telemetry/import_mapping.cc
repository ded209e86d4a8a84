#include "telemetry/import_mapping.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_text.h"
#include "base/try.h"
#include "describe/schema.h"
#include "telemetry/stamp.h"

namespace joulecast::telemetry {

using Json = nlohmann::json;
using Combine = FieldExpression::Combine;
NLOHMANN_JSON_SERIALIZE_ENUM(Combine, {{Combine::sum, "sum"}, {Combine::mean, "mean"}})

static double scale_of(const Json& v) {
  return v.value("scale", 1.0) * (v.value("negate", false) ? -1 : 1);
}

// A name, or an object with a column.
static void from_json(const Json& v, ColumnTerm& term) {
  v.is_string() ? v.get_to(term.column) : v["column"].get_to(term.column);
  if (v.is_object()) term.scale = scale_of(v);
}

static void from_json(const Json& v, FieldExpression& e) {
  e.combine = v.value("combine", Combine::sum);
  if (v.contains("constant")) e.combine = Combine::constant;
  if (v.contains("quaternion_yaw")) e.combine = Combine::quaternion_yaw;
  e.constant = v.value("constant", e.constant);
  if (v.contains("column")) e.terms.push_back({v["column"]});
  for (const char* name : {"columns", "quaternion_yaw"}) e.terms = v.value(name, e.terms);
  e.over = v.value("over", e.over);
  e.sign_from = v.value("sign_from", e.sign_from);
  e.divide_by = v.value("divide_by", e.divide_by);
  e.scale = scale_of(v);
  if (v.contains("wraps_at")) e.wraps_at = v["wraps_at"].get<double>();
  if (v.contains("rate")) e.rate_window_s = v["rate"].value("window_s", 0.0);
}

static void from_json(const Json& v, TableLayout& layout) {
  const std::string separator = v.value("separator", "");
  layout.format.separator = separator.empty() ? '\0' : separator == "blanks" ? ' ' : separator[0];
  layout.format.comment = v.value("comment", "");
  layout.format.skip_lines = v.value("skip_lines", std::size_t{0});
  layout.format.header = v.value("header", layout.format.header);
  layout.no_value = v.value("no_value", layout.no_value);
  layout.column_prefix = v.value("column_prefix", "");
  const Json& time = v["time"];
  layout.rate_hz = time.value("rate_hz", 0.0);
  if (time.contains("column")) layout.time_columns.push_back({time["column"]});
  layout.time_columns = time.value("columns", layout.time_columns);
  static const std::map<std::string, std::int64_t> units{
      {"ns", 1}, {"us", 1'000}, {"ms", 1'000'000}, {"s", 1'000'000'000}, {"iso8601", 0}};
  layout.time_unit_ns = units.at(time.value("unit", "s"));
  layout.time_format = time.value("format", "");
  layout.utc_offset = time.value("utc_offset", "");
  layout.wraps_at = time.value("wraps_at", 0.0);
}

namespace {

using Faults = std::vector<FieldFault>;

// The object that a member is; without members where it is absent.
const Json& members(const Json& v, const char* name) {
  static const Json none = Json::object();
  return v.contains(name) ? v[name] : none;
}

// A layout that its schema accepts, and the constraints between its members.
TableLayout read_layout(const Json& v, const std::string& pointer, Faults& faults) {
  TableLayout layout = v;
  const std::string at = pointer + "/time/";
  const bool stamps = layout.time_unit_ns == 0;
  if (layout.wraps_at > 0 && stamps) faults.push_back({at + "wraps_at", "is for numbers"});
  if (auto zone = StampReader::create(layout.utc_offset); !zone)
    faults.push_back({at + "utc_offset", zone.error().message});
  for (const char* member : {"format", "utc_offset"})
    if (v["time"].contains(member) && !stamps)
      faults.push_back({at + member, "is allowed with the unit iso8601 only"});
  return layout;
}

std::vector<ImportTarget> read_field(const std::string& name, const Json& field, Faults& faults) {
  std::vector<ImportTarget> targets;
  std::vector<std::size_t> numbers;
  for (std::size_t k = 0; k < signals::sample_numbers; ++k)
    if (signals::sample_fields[k].name == name) numbers.push_back(k);
  for (std::size_t side = 0; side < numbers.size(); ++side) {
    const Json& one = field.is_array() ? field[side] : field;
    const std::string index = std::to_string(side);
    if (one.is_null()) continue;
    targets.push_back({field.is_array() ? name + "[" + index + "]" : name, one, numbers[side]});
    const FieldExpression& e = targets.back().expression;
    if (e.rate_window_s && !e.sign_from.empty())
      faults.push_back({"/fields/" + name + (field.is_array() ? "/" + index : "") + "/rate",
                        "must not be combined with sign_from, which would act on the position"});
  }
  return targets;
}

// Returns the content, which is usable where there are no faults.
ImportMapping read_mapping(const Json& v, Faults& faults) {
  static const described::Schema schema = described::Schema::parse(import_mapping_schema);
  faults = described::schema_faults(schema, v);
  ImportMapping content;
  if (!faults.empty()) return content;
  content.layout = read_layout(v, "", faults);
  content.robot_id = v["robot_id"];
  content.mission_column = members(v, "mission").value("column", "");
  content.mission_id = v.value("mission_id", content.mission_column.empty() ? "{stem}" : "{mission}");
  content.payload_kg = v.value("payload_kg", content.payload_kg);
  for (const auto& [name, table] : members(v, "tables").items())
    content.joined.push_back({name, table["file"], read_layout(table, "/tables/" + name, faults),
                              table.value("tolerance_s", JoinedTable().tolerance_s)});
  content.hold_empty_cells = v.value("empty_cells", "hold") == "hold";
  content.rows_on_change = v.value("rows", "all") == "on_change";
  members(v, "require").get_to(content.require);
  for (const auto& [column, one] : members(v, "column_limits").items()) {
    ValueLimits& limits = content.column_limits[column];
    limits = {one.value("low", limits.low), one.value("high", limits.high), one["outside"] == "hold"};
    if (limits.low >= limits.high) faults.push_back({"/column_limits/" + column, "low must be below high"});
  }
  for (const auto& [name, field] : v["fields"].items())
    for (ImportTarget& target : read_field(name, field, faults)) content.targets.push_back(std::move(target));
  for (const auto& [name, covariate] : members(v, "covariates").items()) {
    content.covariates.push_back({name, covariate});
    if (covariate.contains("rate"))
      faults.push_back({"/covariates/" + name + "/rate", "belongs to fields, not to covariates"});
  }
  return content;
}

// The text in brackets at the end of a column's name, as in "speed [km/h]", if it is short enough for a unit.
std::string_view unit_of(std::string_view column) {
  const std::size_t open = column.find_last_of("[("), close = column.find_last_of("])");
  if (open == column.npos || close != column.size() - 1 || close < open) return {};
  const std::string_view text = column.substr(open + 1, close - open - 1);
  const auto is_letter = [](unsigned char c) { return std::isalpha(c) != 0; };
  return text.size() > 3 && std::ranges::all_of(text, is_letter) ? std::string_view() : text;
}

// Whether the name of a channel ends with the unit, as yaw_rate_rad_s does with rad/s.
bool is_in(std::string_view unit, std::string_view channel) {
  std::string suffix = "_";
  for (const unsigned char c : unit)
    if (c == '/' || std::isalnum(c) != 0) suffix += c == '/' ? '_' : static_cast<char>(std::tolower(c));
  return channel.ends_with(suffix);
}

}  // namespace

Result<ImportMapping> ImportMapping::parse(std::string_view text) {
  TRY_ASSIGN(const auto document, parse_json(text));
  Faults faults;
  ImportMapping mapping = read_mapping(document, faults);
  if (faults.empty()) return mapping;
  return tl::unexpected(error_of(faults));
}

std::vector<FieldFault> mapping_faults(std::string_view text) {
  const auto document = parse_json(text);
  if (!document) return {{document.error().field, document.error().message}};
  Faults faults;
  (void)read_mapping(*document, faults);
  return faults;
}

std::vector<FieldFault> suspicious(const ImportMapping& mapping) {
  Faults found;
  std::map<std::string_view, const FieldExpression*> given;
  for (const ImportTarget& target : mapping.targets) given[target.name] = &target.expression;
  const auto both = [&](const char* one, const char* other) {
    return given.contains(one) && given.contains(other);
  };
  if (!both("battery_voltage", "battery_current") && !both("motor_voltage[0]", "motor_current[0]"))
    found.push_back(
        {"/fields",
         std::string("contains neither voltage and current of the battery nor those of the motors: power "
                     "is unknown") +
             (given.contains("battery_current")
                  ? ". A voltage that was not recorded may be stated: \"battery_voltage\": "
                    "{\"constant\": <volts>}"
                  : "")});
  for (const auto& [name, expression] : given) {
    // A constant pitch is a statement: that a dynamometer is flat.
    if (expression->combine != Combine::constant || name == "pitch") continue;
    found.push_back(
        {std::string("/fields/").append(name),
         name == "battery_voltage"
             ? "is a constant: power is computed with it, but the voltage itself has no information"
             : "is a constant, not a measurement: leave it out"});
  }
  for (const auto& [name, e, number] : mapping.targets) {
    if (e.combine == Combine::quaternion_yaw || !e.over.empty() || e.rate_window_s) continue;
    for (const ColumnTerm& term : e.terms) {
      const std::string_view unit = unit_of(term.column), channel = signals::sample_fields[number].key;
      if (unit.empty() || is_in(unit, channel) || std::fabs(term.scale * e.scale / e.divide_by) != 1)
        continue;
      found.push_back(
          {"/fields/" + name, fmt::format("column \"{}\" is read as {} without a scale: is its unit {}?",
                                          term.column, channel, unit)});
    }
  }
  for (const std::string field : {"wheel_velocity", "motor_voltage", "motor_current"}) {
    if (!given.contains(field + "[0]") || !given.contains(field + "[1]")) continue;
    const auto& right = given[field + "[0]"]->terms;
    if (!right.empty() && right == given[field + "[1]"]->terms)
      found.push_back({"/fields/" + field, "reads both sides from the same columns"});
  }
  return found;
}

}  // namespace joulecast::telemetry
