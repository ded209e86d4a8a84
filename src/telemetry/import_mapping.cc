#include "telemetry/import_mapping.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_text.h"
#include "base/try.h"
#include "describe/schema_faults.h"
#include "signals/covariates.h"
#include "telemetry/stamp.h"

namespace joulecast::telemetry {
namespace {

using Json = nlohmann::json;
using Combine = FieldExpression::Combine;

// The object that a member is; without members where it is absent.
const Json& members(const Json& v, const char* name) {
  static const Json none = Json::object();
  return v.contains(name) ? v[name] : none;
}

// Reads a document that its schema accepts, and checks the constraints between its members.
class Reader {
 public:
  explicit Reader(std::vector<MappingFinding>& faults) : faults_(faults) {}

  ImportMapping mapping(const Json& v) {
    ImportMapping content;
    content.layout = layout(v, "");
    content.robot_id = v["robot_id"];
    if (v.contains("mission")) content.mission_column = v["mission"]["column"];
    const bool named = !content.mission_column.empty();
    content.mission_id = v.value("mission_id", named ? "{mission}" : "{stem}");
    if (named && content.mission_id.find("{mission}") == std::string::npos)
      refuse("/mission_id", "must have {mission}, as a column names the missions");
    content.payload_kg = v.value("payload_kg", content.payload_kg);
    for (const auto& [name, table] : members(v, "tables").items())
      content.joined.push_back({name, table["file"], layout(table, "/tables/" + name),
                                table.value("tolerance_s", JoinedTable().tolerance_s)});
    content.hold_empty_cells = v.value("empty_cells", "hold") == "hold";
    content.rows_on_change = v.value("rows", "all") == "on_change";
    content.require = members(v, "require").get<std::map<std::string, std::string>>();
    for (const auto& [column, one] : members(v, "column_limits").items()) {
      ValueLimits& limits = content.column_limits[column];
      limits = {one.value("low", limits.low), one.value("high", limits.high), one["outside"] == "hold"};
      if (limits.low >= limits.high) refuse("/column_limits/" + column, "low must be below high");
    }
    for (const auto& [name, field] : v["fields"].items()) {
      const std::string here = "/fields/" + name;
      std::size_t side = 0;
      for (std::size_t k = 0; k < signals::sample_numbers; ++k) {
        if (signals::sample_fields[k].name != name) continue;
        if (!field.is_array()) {
          content.targets.push_back({name, expression(field, here), k});
          continue;
        }
        const std::string index = std::to_string(side);
        if (!field[side].is_null())
          content.targets.push_back(
              {name + "[" + index + "]", expression(field[side], here + "/" + index), k});
        ++side;
      }
    }
    for (const auto& [name, covariate] : members(v, "covariates").items()) {
      content.covariates.push_back({name, expression(covariate, "/covariates/" + name)});
      if (covariate.contains("rate"))
        refuse("/covariates/" + name + "/rate", "belongs to fields, not to covariates");
    }
    for (const auto& [quantity, label] : members(v, "labels").items())
      content.labels[quantity] = label["column"];
    if (content.covariates.size() + content.labels.size() > signals::max_covariates)
      refuse("/covariates",
             "must be at most " + std::to_string(signals::max_covariates) + ", labels among them");
    return content;
  }

 private:
  void refuse(std::string pointer, std::string says) {
    faults_.push_back({std::move(pointer), std::move(says)});
  }

  static double scale_of(const Json& v) {
    return v.value("scale", 1.0) * (v.value("negate", false) ? -1 : 1);
  }

  // Of a member that is a name, or a list of names and of objects with a column; none where it is absent.
  static std::vector<ColumnTerm> terms(const Json& v, const char* name) {
    std::vector<ColumnTerm> all;
    if (!v.contains(name)) return all;
    for (const Json& each : v[name].is_array() ? v[name] : Json::array({v[name]}))
      if (each.is_string())
        all.push_back({each.get<std::string>()});
      else
        all.push_back({each["column"].get<std::string>(), scale_of(each)});
    return all;
  }

  FieldExpression expression(const Json& v, const std::string& pointer) {
    FieldExpression e;
    const std::string how = v.value("combine", "sum");
    e.combine = v.contains("constant")         ? Combine::constant
                : v.contains("quaternion_yaw") ? Combine::quaternion_yaw
                : how == "mean"                ? Combine::mean
                : how == "product"             ? Combine::product
                                               : Combine::sum;
    e.constant = v.value("constant", e.constant);
    for (const char* name : {"column", "columns", "quaternion_yaw"})
      if (v.contains(name)) e.terms = terms(v, name);
    e.over = terms(v, "over");
    e.sign_from = terms(v, "sign_from");
    e.divide_by = v.value("divide_by", 1.0);
    e.scale = scale_of(v);
    if (v.contains("wraps_at")) e.wraps_at = v["wraps_at"].get<double>();
    if (!v.contains("rate")) return e;
    e.rate_window_s = v["rate"].value("window_s", 0.0);
    // In the unit of the field.
    if (v["rate"].contains("wraps_at"))
      e.wraps_at = v["rate"]["wraps_at"].get<double>() * std::abs(e.divide_by / e.scale);
    if (!e.sign_from.empty())
      refuse(pointer + "/rate", "does not go with sign_from, which would act on the position");
    return e;
  }

  TableLayout layout(const Json& v, const std::string& pointer) {
    TableLayout layout;
    const std::string separator = v.value("separator", "");
    layout.format.blanks = separator == "blanks";
    layout.format.separator = separator.empty() ? '\0' : separator[0];
    layout.decimal_comma = v.value("decimal", ".") == ",";
    layout.format.comment = v.value("comment", "");
    layout.format.skip_lines = v.value("skip_lines", std::size_t{0});
    layout.format.header = v.value("header", layout.format.header);
    layout.no_value = v.value("no_value", layout.no_value);
    layout.column_prefix = v.value("column_prefix", "");
    const Json& time = v["time"];
    layout.rate_hz = time.value("rate_hz", 0.0);
    layout.time_columns = terms(time, time.contains("column") ? "column" : "columns");
    const std::string unit = time.value("unit", "s");
    layout.time_unit_ns = unit == "ns"   ? 1
                          : unit == "us" ? 1'000
                          : unit == "ms" ? 1'000'000
                          : unit == "s"  ? 1'000'000'000
                                         : 0;
    layout.time_format = time.value("format", "");
    layout.utc_offset = time.value("utc_offset", "");
    layout.wraps_at = time.value("wraps_at", 0.0);
    const std::string at = pointer + "/time/";
    const bool stamps = layout.time_unit_ns == 0;
    if (layout.wraps_at > 0 && stamps) refuse(at + "wraps_at", "is for numbers");
    if (auto zone = StampReader::create(layout.utc_offset); !zone)
      refuse(at + "utc_offset", zone.error().message);
    for (const char* member : {"format", "utc_offset"})
      if (time.contains(member) && !stamps) refuse(at + member, "goes with the unit iso8601 only");
    return layout;
  }

  std::vector<MappingFinding>& faults_;
};

// A decimal comma needs a separator that is none.
void check_decimal(const Json& table, const std::string& pointer, std::vector<MappingFinding>& faults) {
  if (!table.is_object() || table.value("decimal", Json()) != ",") return;
  const Json separator = table.value("separator", Json(","));
  if (separator == ",")
    faults.push_back({pointer + "/decimal", "is the separator too: give separator, often \";\""});
}

// Returns the content, which is usable where there are no faults.
ImportMapping read_mapping(const Json& document, std::vector<MappingFinding>& faults) {
  static const described::Schema schema = described::Schema::parse(import_mapping_schema);
  for (auto& [field, says] : described::schema_faults(schema, document)) faults.push_back({field, says});
  const bool readable = faults.empty();
  check_decimal(document, "", faults);
  if (!readable) return {};
  for (const auto& [name, table] : members(document, "tables").items())
    check_decimal(table, "/tables/" + name, faults);
  return Reader(faults).mapping(document);
}

}  // namespace

Result<ImportMapping> ImportMapping::parse(std::string_view text) {
  TRY_ASSIGN(const auto document, parse_json(text));
  std::vector<MappingFinding> faults;
  ImportMapping mapping = read_mapping(document, faults);
  if (faults.empty()) return mapping;
  // One error of all, at the first one's place.
  Error error{Fault::invalid, faults.front().field, faults.front().says};
  for (std::size_t k = 1; k < faults.size(); ++k)
    error.message += "; " + faults[k].field + ": " + faults[k].says;
  return tl::unexpected(std::move(error));
}

std::vector<MappingFinding> mapping_faults(std::string_view text) {
  const auto document = parse_json(text);
  if (!document) return {{document.error().field, document.error().message}};
  std::vector<MappingFinding> faults;
  (void)read_mapping(*document, faults);
  return faults;
}

std::vector<MappingFinding> suspicious(const ImportMapping& mapping) {
  std::vector<MappingFinding> found;
  std::map<std::string_view, const FieldExpression*> given;
  for (const ImportTarget& target : mapping.targets) given[target.name] = &target.expression;
  const auto has = [&](std::string_view name) { return given.contains(name); };
  if (!(has("battery_voltage") && has("battery_current")) &&
      !(has("motor_voltage[0]") && has("motor_current[0]")))
    found.push_back({"/fields",
                     "give neither the battery's voltage and current nor the motors': no power "
                     "will be available"});
  for (const auto& [name, expression] : given) {
    const std::string here = std::string("/fields/").append(name);
    if (expression->combine == Combine::constant && name == "battery_voltage")
      found.push_back(
          {here, "is a constant: power is the current times it, but nothing is learnt from the voltage"});
    // A constant pitch is a statement: that a dynamometer is flat.
    else if (expression->combine == Combine::constant && name != "pitch")
      found.push_back({here, "is a constant, not a measurement: leave it out"});
  }
  for (const std::string field : {"wheel_velocity", "motor_voltage", "motor_current"}) {
    if (!has(field + "[0]") || !has(field + "[1]")) continue;
    const auto& right = given[field + "[0]"]->terms;
    if (!right.empty() && right == given[field + "[1]"]->terms)
      found.push_back({"/fields/" + field, "reads both sides from the same columns"});
  }
  return found;
}

}  // namespace joulecast::telemetry
