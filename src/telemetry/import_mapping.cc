#include "telemetry/import_mapping.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/json_text.h"
#include "base/try.h"
#include "signals/covariates.h"
#include "signals/ids.h"
#include "telemetry/codec.h"
#include "telemetry/stamp.h"

namespace joulecast::telemetry {
namespace {

using Json = nlohmann::json;

// Reads members of one JSON document; faulty ones get defaults.
class Reader {
 public:
  std::vector<MappingFinding> faults;

  void refuse(std::string pointer, std::string message) {
    if (refused_.insert(pointer).second) faults.push_back({std::move(pointer), std::move(message)});
  }

  bool object(const Json& value, const std::string& pointer, std::initializer_list<std::string_view> known) {
    if (!value.is_object()) {
      refuse(pointer, "must be an object");
      return false;
    }
    for (const auto& [key, member] : value.items()) {
      if (std::find(known.begin(), known.end(), key) == known.end())
        refuse(pointer + "/" + key, "is not a member of a mapping");
    }
    return true;
  }

  std::string text(const Json& value, const std::string& pointer) {
    if (value.is_string() && !value.get_ref<const std::string&>().empty()) return value.get<std::string>();
    refuse(pointer, "must be a string of one character at least");
    return {};
  }

  bool boolean(const Json& value, const std::string& pointer) {
    if (value.is_boolean()) return value.get<bool>();
    refuse(pointer, "must be true or false");
    return false;
  }

  double number(const Json& value, const std::string& pointer) {
    if (value.is_number() && std::isfinite(value.get<double>())) return value.get<double>();
    refuse(pointer, "must be a finite number");
    return 0;
  }

  template <class Choice>
  Choice choice(const Json& value, const std::string& pointer,
                std::initializer_list<std::pair<std::string_view, Choice>> choices) {
    std::string names;
    for (const auto& [name, meaning] : choices) {
      if (value == name) return meaning;
      names.append(names.empty() ? "" : ", ").append(name);
    }
    refuse(pointer, "must be one of " + names);
    return choices.begin()->second;
  }

  ColumnTerm term(const Json& value, const std::string& pointer) {
    ColumnTerm result;
    if (value.is_string()) {
      result.column = text(value, pointer);
      return result;
    }
    if (!object(value, pointer, {"column", "negate", "scale"})) return result;
    result.column = text(value.value("column", Json()), pointer + "/column");
    if (value.contains("scale")) result.scale = number(value["scale"], pointer + "/scale");
    if (value.contains("negate") && boolean(value["negate"], pointer + "/negate"))
      result.scale = -result.scale;
    return result;
  }

  std::vector<ColumnTerm> terms(const Json& value, const std::string& pointer) {
    std::vector<ColumnTerm> result;
    if (!value.is_array() || value.empty()) {
      refuse(pointer, "must be an array of one column at least");
      return result;
    }
    for (std::size_t i = 0; i < value.size(); ++i)
      result.push_back(term(value[i], pointer + "/" + std::to_string(i)));
    return result;
  }

  ValueLimits limits(const Json& value, const std::string& pointer) {
    ValueLimits result;
    if (!object(value, pointer, {"low", "high", "outside"})) return result;
    if (value.contains("low")) result.low = number(value["low"], pointer + "/low");
    if (value.contains("high")) result.high = number(value["high"], pointer + "/high");
    if (!(result.low < result.high)) refuse(pointer, "low must be below high");
    result.holds = choice<bool>(value.value("outside", Json()), pointer + "/outside",
                                {{"hold", true}, {"unmeasured", false}});
    return result;
  }

  void source(const Json& value, const std::string& pointer, FieldExpression& result) {
    const auto sources = value.count("constant") + value.count("column") + value.count("columns") +
                         value.count("quaternion_yaw");
    if (sources != 1) refuse(pointer, "must have exactly one of constant, column, columns, quaternion_yaw");
    if (value.contains("constant")) {
      result.constant = number(value["constant"], pointer + "/constant");
    } else if (value.contains("column")) {
      result.source = FieldExpression::Source::columns;
      result.terms.emplace_back().column = text(value["column"], pointer + "/column");
    } else if (value.contains("columns")) {
      result.source = FieldExpression::Source::columns;
      result.terms = terms(value["columns"], pointer + "/columns");
    } else if (value.contains("quaternion_yaw")) {
      result.source = FieldExpression::Source::quaternion_yaw;
      result.terms = terms(value["quaternion_yaw"], pointer + "/quaternion_yaw");
      if (result.terms.size() != 4)
        refuse(pointer + "/quaternion_yaw", "must name the columns of x, y, z and w");
    }
    if (value.contains("combine"))
      result.combine =
          choice<Combine>(value["combine"], pointer + "/combine",
                          {{"sum", Combine::sum}, {"mean", Combine::mean}, {"product", Combine::product}});
    if (value.contains("over")) result.over = terms(value["over"], pointer + "/over");
  }

  double positive(const Json& value, const std::string& pointer) {
    const double result = number(value, pointer);
    if (result <= 0) refuse(pointer, "must be above 0");
    return result;
  }

  // Its wraps_at is in the unit of the field.
  RateOf rate(const Json& value, const std::string& pointer, FieldExpression& of) {
    RateOf result;
    if (!object(value, pointer, {"window_s", "wraps_at"})) return result;
    if (value.contains("window_s")) result.window_s = number(value["window_s"], pointer + "/window_s");
    if (result.window_s < 0) refuse(pointer + "/window_s", "must not be negative");
    if (value.contains("wraps_at"))
      of.wraps_at = positive(value["wraps_at"], pointer + "/wraps_at") * std::abs(of.divide_by / of.scale);
    return result;
  }

  FieldExpression expression(const Json& value, const std::string& pointer, bool may_be_rate = true) {
    FieldExpression result;
    if (!object(value, pointer,
                {"constant", "column", "columns", "quaternion_yaw", "combine", "over", "sign_from", "negate",
                 "scale", "divide_by", "wraps_at", "rate"})) {
      return result;
    }
    source(value, pointer, result);
    if (value.contains("sign_from")) result.sign_from = terms(value["sign_from"], pointer + "/sign_from");
    if (value.contains("negate")) result.negate = boolean(value["negate"], pointer + "/negate");
    if (value.contains("scale")) result.scale = number(value["scale"], pointer + "/scale");
    if (value.contains("divide_by")) result.divide_by = number(value["divide_by"], pointer + "/divide_by");
    if (result.divide_by == 0) refuse(pointer + "/divide_by", "must not be 0");
    if (value.contains("wraps_at")) result.wraps_at = positive(value["wraps_at"], pointer + "/wraps_at");
    if (!value.contains("rate")) return result;
    result.rate = rate(value["rate"], pointer + "/rate", result);
    if (!may_be_rate) refuse(pointer + "/rate", "belongs to fields, not to covariates");
    if (!result.sign_from.empty())
      refuse(pointer + "/rate", "does not go with sign_from, which would act on the position");
    return result;
  }

  std::vector<FieldTarget> fields(const Json& value, const std::string& pointer) {
    std::vector<FieldTarget> targets;
    if (!value.is_object()) {
      refuse(pointer, "must be an object");
      return targets;
    }
    bool all = true;
    for (const auto& [name, member] : value.items()) {
      const std::string here = pointer + "/" + name;
      std::vector<std::size_t> numbers;
      for (std::size_t k = 0; k < signals::sample_numbers; ++k)
        if (signals::sample_fields[k].name == name) numbers.push_back(k);
      if (name == "payload_mass") refuse(here, "is the mission's: give payload_kg next to fields");
      if (numbers.empty()) refuse(here, "is no field of a sample that a table can fill");
      if (numbers.empty() || name == "payload_mass") {
        all = false;
        break;
      }
      if (numbers.size() == 1) {
        targets.push_back({name, numbers[0], expression(member, here)});
        continue;
      }
      if (!member.is_array() || member.size() != numbers.size()) {
        refuse(here,
               "must be an array of " + std::to_string(numbers.size()) + " expressions (null: not measured)");
        all = false;
        break;
      }
      for (std::size_t i = 0; i < numbers.size(); ++i) {
        if (member[i].is_null()) continue;
        const std::string index = std::to_string(i);
        targets.push_back({name + "[" + index + "]", numbers[i], expression(member[i], here + "/" + index)});
      }
    }
    const auto wheels = std::ranges::count_if(targets, [](const FieldTarget& target) {
      return signals::sample_fields[target.number].name == "wheel_velocity";
    });
    if (all && wheels != 2)
      refuse(pointer + "/wheel_velocity", "must give both wheels: no sample is without them");
    return targets;
  }

  // Calls `take` with the name, the value and the pointer of each member of an object in `value`, if it has
  // one.
  void each(const Json& value, const std::string& name, const auto& take) {
    if (!value.contains(name)) return;
    if (!value[name].is_object()) return refuse("/" + name, "must be an object");
    for (const auto& [key, member] : value[name].items()) take(key, member, "/" + name + "/" + key);
  }

  void covariates(const Json& value, ImportMapping::Content& content) {
    const auto check = [&](const std::string& name, const std::string& here) {
      if (!signals::is_valid_covariate_name(name) || signals::is_label(name))
        refuse(here, "must be called by 1 to " + std::to_string(signals::max_covariate_name_length) +
                         " of letters, digits, '.', '_', '-'");
    };
    each(value, "covariates", [&](const std::string& name, const Json& member, const std::string& here) {
      check(name, here);
      content.covariates.push_back({name, expression(member, here, false)});
    });
    each(value, "labels", [&](const std::string& name, const Json& member, const std::string& here) {
      check(name, here);
      if (object(member, here, {"column"}))
        content.labels.push_back({name, text(member.value("column", Json()), here + "/column")});
    });
    if (content.covariates.size() + content.labels.size() > signals::max_covariates)
      refuse("/covariates",
             "must be at most " + std::to_string(signals::max_covariates) + ", labels among them");
  }

  void time(const Json& value, const std::string& pointer, TableLayout& layout) {
    if (!object(value, pointer, {"column", "columns", "rate_hz", "unit", "format", "wraps_at", "utc_offset"}))
      return;
    if (value.contains("rate_hz")) {
      layout.rate_hz = positive(value["rate_hz"], pointer + "/rate_hz");
    } else if (value.contains("columns")) {
      layout.time_columns = terms(value["columns"], pointer + "/columns");
    } else if (value.contains("column")) {
      layout.time_columns.push_back({text(value["column"], pointer + "/column"), 1});
    } else {
      refuse(pointer + "/column",
             "is missing; a table without times has rate_hz instead, the rows of a second");
    }
    if (layout.rate_hz > 0 && value.size() == 1) return;
    layout.time_unit_ns = choice<std::int64_t>(
        value.value("unit", Json()), pointer + "/unit",
        {{"s", 1'000'000'000}, {"ms", 1'000'000}, {"us", 1'000}, {"ns", 1}, {"iso8601", 0}});
    if (value.contains("wraps_at")) layout.wraps_at = positive(value["wraps_at"], pointer + "/wraps_at");
    if (layout.wraps_at > 0 && layout.time_unit_ns == 0) refuse(pointer + "/wraps_at", "is for numbers");
    if (value.contains("format")) layout.time_format = text(value["format"], pointer + "/format");
    if (value.contains("utc_offset")) layout.utc_offset = text(value["utc_offset"], pointer + "/utc_offset");
    if (auto zone = StampReader::create(layout.utc_offset); !zone)
      refuse(pointer + "/utc_offset", zone.error().message);
    for (const char* member : {"format", "utc_offset"})
      if (value.contains(member) && layout.time_unit_ns != 0)
        refuse(pointer + "/" + member, "goes with the unit iso8601 only");
  }

  // The members that describe the layout of a table; `pointer` is of the object that contains them.
  void layout(const Json& value, const std::string& pointer, TableLayout& result) {
    if (value.contains("separator")) {
      const std::string separator = text(value["separator"], pointer + "/separator");
      result.format.blanks = separator == "blanks";
      if (!result.format.blanks &&
          (separator.size() != 1 || separator == "\"" || separator == "\n" || separator == "\r"))
        refuse(pointer + "/separator", "must be \"blanks\" or one character, not a quote or line end");
      else
        result.format.separator = separator[0];
    }
    if (value.contains("decimal"))
      result.decimal_comma =
          choice<bool>(value["decimal"], pointer + "/decimal", {{".", false}, {",", true}});
    if (result.decimal_comma && !result.format.blanks &&
        (result.format.separator == ',' || result.format.separator == '\0'))
      refuse(pointer + "/decimal", "is the separator too: give separator, often \";\"");
    if (value.contains("comment")) result.format.comment = text(value["comment"], pointer + "/comment");
    if (value.contains("skip_lines")) {
      if (value["skip_lines"].is_number_integer() && value["skip_lines"] >= 0 &&
          value["skip_lines"] <= 10'000)
        result.format.skip_lines = value["skip_lines"].get<std::size_t>();
      else
        refuse(pointer + "/skip_lines", "must be a whole number from 0 to 10000");
    }
    if (value.contains("header"))
      for (const ColumnTerm& term : terms(value["header"], pointer + "/header"))
        result.format.header.push_back(term.column);
    if (value.contains("no_value"))
      for (const ColumnTerm& term : terms(value["no_value"], pointer + "/no_value"))
        result.no_value.push_back(term.column);
    if (value.contains("column_prefix"))
      result.column_prefix = text(value["column_prefix"], pointer + "/column_prefix");
    time(value.value("time", Json()), pointer + "/time", result);
  }

  void joined(const std::string& name, const Json& member, const std::string& here,
              ImportMapping::Content& content) {
    JoinedTable table;
    table.name = name;
    if (name.empty() || name.find(':') != std::string::npos) refuse(here, "must be a name without ':'");
    if (!object(member, here,
                {"file", "tolerance_s", "separator", "decimal", "comment", "skip_lines", "header", "no_value",
                 "column_prefix", "time"}))
      return;
    table.file = text(member.value("file", Json()), here + "/file");
    if (member.contains("tolerance_s"))
      table.tolerance_s = number(member["tolerance_s"], here + "/tolerance_s");
    if (table.tolerance_s <= 0 || table.tolerance_s > 1e6)
      refuse(here + "/tolerance_s", "must be above 0 and at most 1000000");
    layout(member, here, table.layout);
    content.joined.push_back(std::move(table));
  }

  void names(const Json& value, ImportMapping::Content& content) {
    content.robot_id = text(value.value("robot_id", Json()), "/robot_id");
    if (!signals::is_valid_robot_id(content.robot_id)) {
      refuse("/robot_id", "must be 1 to " + std::to_string(signals::max_robot_id_length) +
                              " of letters, digits, '.', '_', '-'");
    }
    if (value.contains("mission")) {
      const Json& mission = value["mission"];
      if (object(mission, "/mission", {"column"}))
        content.mission_column = text(mission.value("column", Json()), "/mission/column");
      content.mission_id = "{mission}";
    }
    if (value.contains("mission_id")) content.mission_id = text(value["mission_id"], "/mission_id");
    if (!content.mission_column.empty() && content.mission_id.find("{mission}") == std::string::npos)
      refuse("/mission_id", "must hold {mission}, for a column names the missions");
    if (value.contains("payload_kg")) {
      content.payload_kg = number(value["payload_kg"], "/payload_kg");
      if (content.payload_kg < 0) refuse("/payload_kg", "must not be negative");
    }
  }

  ImportMapping::Content mapping(const Json& value) {
    ImportMapping::Content content;
    if (!object(value, "",
                {"$schema",    "description", "robot_id",    "mission_id", "mission",       "payload_kg",
                 "separator",  "decimal",     "comment",     "skip_lines", "header",        "column_prefix",
                 "time",       "tables",      "empty_cells", "require",    "column_limits", "fields",
                 "covariates", "labels",      "no_value",    "rows"})) {
      return content;
    }
    names(value, content);
    layout(value, "", content.layout);
    each(value, "tables", [&](const std::string& name, const Json& member, const std::string& here) {
      joined(name, member, here, content);
    });
    if (value.contains("empty_cells")) {
      content.hold_empty_cells =
          choice<bool>(value["empty_cells"], "/empty_cells", {{"hold", true}, {"unmeasured", false}});
    }
    if (value.contains("rows"))
      content.rows_on_change = choice<bool>(value["rows"], "/rows", {{"all", false}, {"on_change", true}});
    each(value, "require", [&](const std::string& column, const Json& wanted, const std::string& here) {
      content.require[column] = text(wanted, here);
    });
    each(value, "column_limits", [&](const std::string& column, const Json& given, const std::string& here) {
      content.column_limits[column] = limits(given, here);
    });
    content.targets = fields(value.value("fields", Json()), "/fields");
    covariates(value, content);
    return content;
  }

 private:
  std::set<std::string> refused_;
};

}  // namespace

Result<ImportMapping> ImportMapping::parse(std::string_view text) {
  TRY_ASSIGN(const auto document, parse_json(text));
  Reader reader;
  auto content = std::make_shared<const Content>(reader.mapping(document));
  if (reader.faults.empty()) return ImportMapping(std::move(content));
  // One error of all, at the first one's place.
  Error error{Fault::invalid, reader.faults.front().field, reader.faults.front().says};
  for (std::size_t k = 1; k < reader.faults.size(); ++k)
    error.message += "; " + reader.faults[k].field + ": " + reader.faults[k].says;
  return tl::unexpected(std::move(error));
}

std::vector<MappingFinding> mapping_faults(std::string_view text) {
  const auto document = parse_json(text);
  if (!document) return {{document.error().field, document.error().message}};
  Reader reader;
  (void)reader.mapping(*document);
  return std::move(reader.faults);
}

std::vector<MappingFinding> suspicious(const ImportMapping& mapping) {
  const ImportMapping::Content& content = mapping.content();
  std::vector<MappingFinding> found;
  std::map<std::string_view, const FieldExpression*> given;
  for (const FieldTarget& target : content.targets) given[target.name] = &target.expression;
  const auto has = [&](std::string_view name) { return given.contains(name); };
  const bool battery = has("battery_voltage") && has("battery_current");
  const bool motors = has("motor_voltage[0]") && has("motor_current[0]");
  if (!battery && !motors)
    found.push_back({"/fields",
                     "give neither the battery's voltage and current nor the motors': no power "
                     "will be available"});
  const auto is_constant = [&](std::string_view name) {
    return has(name) && given[name]->source == FieldExpression::Source::constant;
  };
  if (is_constant("battery_voltage"))
    found.push_back({"/fields/battery_voltage",
                     "is a constant: power is the current times it, but nothing is learnt from the voltage"});
  for (const FieldTarget& target : content.targets)
    // A constant pitch is a statement: that a dynamometer is flat.
    if (target.name != "battery_voltage" && target.name != "pitch" && is_constant(target.name))
      found.push_back({"/fields/" + target.name, "is a constant, not a measurement: leave it out"});
  const auto same = [&](const std::string& field) {
    const auto right = given.find(field + "[0]"), left = given.find(field + "[1]");
    if (right == given.end() || left == given.end()) return false;
    const auto& [a, b] = std::pair(right->second->terms, left->second->terms);
    return !a.empty() && std::ranges::equal(a, b, [](const ColumnTerm& x, const ColumnTerm& y) {
      return x.column == y.column && x.scale == y.scale;
    });
  };
  for (const char* field : {"wheel_velocity", "motor_voltage", "motor_current"})
    if (same(field))
      found.push_back({std::string("/fields/") + field, "reads both sides from the same columns"});
  return found;
}

}  // namespace joulecast::telemetry
