#include "telemetry/import_mapping.h"

#include <algorithm>
#include <cmath>
#include <functional>
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

  ImportMapping::Content mapping(const Json& value) {
    ImportMapping::Content content;
    const bool is_object = table(
        value, "", content.layout,
        {{"$schema", ignored},
         {"description", ignored},
         {"robot_id",
          [&](const Json& v, const std::string& at) {
            read(v, at, content.robot_id);
            if (!signals::is_valid_robot_id(content.robot_id))
              refuse(at, "must be 1 to " + std::to_string(signals::max_robot_id_length) +
                             " of letters, digits, '.', '_', '-'");
          },
          true},
         {"mission",
          [&](const Json& v, const std::string& at) {
            object(v, at, {{"column", into(content.mission_column), true}});
            content.mission_id = "{mission}";
          }},
         {"mission_id", into(content.mission_id)},
         {"payload_kg", into(content.payload_kg)},
         {"tables", each([&](const std::string& name, const Json& v, const std::string& at) {
            content.joined.push_back(joined(name, v, at));
          })},
         {"empty_cells", choice(content.hold_empty_cells, {{"hold", true}, {"unmeasured", false}})},
         {"rows", choice(content.rows_on_change, {{"all", false}, {"on_change", true}})},
         {"require", each([&](const std::string& column, const Json& v, const std::string& at) {
            read(v, at, content.require[column]);
          })},
         {"column_limits", each([&](const std::string& column, const Json& v, const std::string& at) {
            content.column_limits[column] = limits(v, at);
          })},
         {"fields", [&](const Json& v, const std::string& at) { content.targets = fields(v, at); }, true},
         {"covariates", each([&](const std::string& name, const Json& v, const std::string& at) {
            check_covariate(name, at);
            content.covariates.push_back({name, expression(v, at, false)});
          })},
         {"labels", each([&](const std::string& name, const Json& v, const std::string& at) {
            check_covariate(name, at);
            object(v, at, {{"column", into(content.labels.emplace_back(name).column), true}});
          })}});
    if (!is_object) return content;
    if (!content.mission_column.empty() && content.mission_id.find("{mission}") == std::string::npos)
      refuse("/mission_id", "must hold {mission}, for a column names the missions");
    if (content.payload_kg < 0) refuse("/payload_kg", "must not be negative");
    if (content.covariates.size() + content.labels.size() > signals::max_covariates)
      refuse("/covariates",
             "must be at most " + std::to_string(signals::max_covariates) + ", labels among them");
    return content;
  }

 private:
  // A member, and how its value is read. A required one that is absent is read as null.
  using Read = std::function<void(const Json&, const std::string& pointer)>;
  struct Member {
    std::string_view name;
    Read how;
    bool required = false;
  };

  static void ignored(const Json&, const std::string&) {}

  void refuse(std::string pointer, std::string message) {
    if (refused_.insert(pointer).second) faults.push_back({std::move(pointer), std::move(message)});
  }

  bool object(const Json& value, const std::string& pointer, const std::vector<Member>& members) {
    if (!value.is_object()) {
      refuse(pointer, "must be an object");
      return false;
    }
    for (const auto& [key, member] : value.items())
      if (std::ranges::find(members, key, &Member::name) == members.end())
        refuse(pointer + "/" + key, "is not a member of a mapping");
    for (const Member& member : members) {
      const auto found = value.find(member.name);
      if (found != value.end() || member.required)
        member.how(found != value.end() ? *found : Json(),
                   std::string(pointer).append("/").append(member.name));
    }
    return true;
  }

  void read(const Json& value, const std::string& pointer, std::string& to) {
    if (value.is_string() && !value.get_ref<const std::string&>().empty())
      to = value.get<std::string>();
    else
      refuse(pointer, "must be a string of one character at least");
  }
  void read(const Json& value, const std::string& pointer, bool& to) {
    if (value.is_boolean())
      to = value.get<bool>();
    else
      refuse(pointer, "must be true or false");
  }
  void read(const Json& value, const std::string& pointer, double& to) {
    if (value.is_number() && std::isfinite(value.get<double>()))
      to = value.get<double>();
    else
      refuse(pointer, "must be a finite number");
  }
  void read(const Json& value, const std::string& pointer, ColumnTerm& to) {
    if (value.is_string()) return read(value, pointer, to.column);
    bool negate = false;
    object(value, pointer,
           {{"column", into(to.column), true}, {"scale", into(to.scale)}, {"negate", into(negate)}});
    if (negate) to.scale = -to.scale;
  }
  template <class One>
  void read(const Json& value, const std::string& pointer, std::vector<One>& to) {
    if (!value.is_array() || value.empty()) return refuse(pointer, "must be an array of one column at least");
    for (std::size_t k = 0; k < value.size(); ++k)
      read(value[k], pointer + "/" + std::to_string(k), to.emplace_back());
  }
  Read into(auto& to) {
    return [this, &to](const Json& value, const std::string& pointer) { read(value, pointer, to); };
  }
  Read positive(auto& to) {
    return [this, &to](const Json& value, const std::string& pointer) {
      double number = 1;
      read(value, pointer, number);
      if (number <= 0) refuse(pointer, "must be above 0");
      to = number;
    };
  }
  template <class Choice>
  Read choice(Choice& to, std::vector<std::pair<std::string_view, Choice>> choices) {
    return [this, &to, choices = std::move(choices)](const Json& value, const std::string& pointer) {
      std::string names;
      for (const auto& [name, meaning] : choices) {
        if (value == name) return void(to = meaning);
        names.append(names.empty() ? "" : ", ").append(name);
      }
      refuse(pointer, "must be one of " + names);
    };
  }
  // Calls `take` with the name, the value and the pointer of each member of an object.
  Read each(auto take) {
    return [this, take](const Json& value, const std::string& pointer) {
      if (!value.is_object()) return refuse(pointer, "must be an object");
      for (const auto& [key, member] : value.items()) take(key, member, pointer + "/" + key);
    };
  }

  ValueLimits limits(const Json& value, const std::string& pointer) {
    ValueLimits result;
    object(value, pointer,
           {{"low", into(result.low)},
            {"high", into(result.high)},
            {"outside", choice(result.holds, {{"hold", true}, {"unmeasured", false}}), true}});
    if (!(result.low < result.high)) refuse(pointer, "low must be below high");
    return result;
  }

  FieldExpression expression(const Json& value, const std::string& pointer, bool may_be_rate = true) {
    using Source = FieldExpression::Source;
    FieldExpression e;
    int sources = 0;
    const auto from = [&](Source source, auto& to) -> Read {
      return [this, &e, &sources, &to, source](const Json& v, const std::string& at) {
        ++sources;
        e.source = source;
        read(v, at, to);
      };
    };
    std::string column;
    // The period of a rate is in the unit of the field.
    const auto rate = [&](const Json& v, const std::string& at) {
      e.rate.emplace();
      object(v, at, {{"window_s", into(e.rate->window_s)}, {"wraps_at", positive(e.wraps_at)}});
      if (e.rate->window_s < 0) refuse(at + "/window_s", "must not be negative");
      if (v.contains("wraps_at")) *e.wraps_at *= std::abs(e.divide_by / e.scale);
    };
    const bool is_object = object(
        value, pointer,
        {{"constant", from(Source::constant, e.constant)},
         {"column", from(Source::columns, column)},
         {"columns", from(Source::columns, e.terms)},
         {"quaternion_yaw", from(Source::quaternion_yaw, e.terms)},
         {"combine",
          choice(e.combine, {{"sum", Combine::sum}, {"mean", Combine::mean}, {"product", Combine::product}})},
         {"over", into(e.over)},
         {"sign_from", into(e.sign_from)},
         {"negate", into(e.negate)},
         {"scale", into(e.scale)},
         {"divide_by", into(e.divide_by)},
         {"wraps_at", positive(e.wraps_at)},
         {"rate", rate}});
    if (!is_object) return e;
    if (sources != 1) refuse(pointer, "must have exactly one of constant, column, columns, quaternion_yaw");
    if (!column.empty()) e.terms.push_back({column});
    if (e.source == Source::quaternion_yaw && e.terms.size() != 4)
      refuse(pointer + "/quaternion_yaw", "must name the columns of x, y, z and w");
    if (e.divide_by == 0) refuse(pointer + "/divide_by", "must not be 0");
    if (e.rate && !may_be_rate) refuse(pointer + "/rate", "belongs to fields, not to covariates");
    if (e.rate && !e.sign_from.empty())
      refuse(pointer + "/rate", "does not go with sign_from, which would act on the position");
    return e;
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

  void check_covariate(const std::string& name, const std::string& pointer) {
    if (!signals::is_valid_covariate_name(name) || signals::is_label(name))
      refuse(pointer, "must be called by 1 to " + std::to_string(signals::max_covariate_name_length) +
                          " of letters, digits, '.', '_', '-'");
  }

  void time(const Json& value, const std::string& pointer, TableLayout& layout) {
    ColumnTerm column;
    const bool is_object =
        object(value, pointer,
               {{"column", into(column.column)},
                {"columns", into(layout.time_columns)},
                {"rate_hz", positive(layout.rate_hz)},
                {"unit",
                 choice<std::int64_t>(
                     layout.time_unit_ns,
                     {{"s", 1'000'000'000}, {"ms", 1'000'000}, {"us", 1'000}, {"ns", 1}, {"iso8601", 0}}),
                 !value.contains("rate_hz") || value.size() > 1},
                {"format", into(layout.time_format)},
                {"wraps_at", positive(layout.wraps_at)},
                {"utc_offset", into(layout.utc_offset)}});
    if (!is_object) return;
    if (layout.rate_hz > 0)
      layout.time_columns.clear();
    else if (!column.column.empty() && layout.time_columns.empty())
      layout.time_columns = {column};
    else if (layout.time_columns.empty())
      refuse(pointer + "/column",
             "is missing; a table without times has rate_hz instead, the rows of a second");
    if (layout.wraps_at > 0 && layout.time_unit_ns == 0) refuse(pointer + "/wraps_at", "is for numbers");
    if (auto zone = StampReader::create(layout.utc_offset); !zone)
      refuse(pointer + "/utc_offset", zone.error().message);
    for (const char* member : {"format", "utc_offset"})
      if (value.contains(member) && layout.time_unit_ns != 0)
        refuse(pointer + "/" + member, "goes with the unit iso8601 only");
  }

  // An object that describes a table: `members`, and those of the layout.
  bool table(const Json& value, const std::string& pointer, TableLayout& layout,
             std::vector<Member> members) {
    std::string separator;
    const auto skip_lines = [&](const Json& v, const std::string& at) {
      if (v.is_number_integer() && v >= 0 && v <= 10'000)
        layout.format.skip_lines = v.get<std::size_t>();
      else
        refuse(at, "must be a whole number from 0 to 10000");
    };
    const std::initializer_list<Member> own{
        {"separator", into(separator)},
        {"decimal", choice(layout.decimal_comma, {{".", false}, {",", true}})},
        {"comment", into(layout.format.comment)},
        {"skip_lines", skip_lines},
        {"header", into(layout.format.header)},
        {"no_value", into(layout.no_value)},
        {"column_prefix", into(layout.column_prefix)},
        {"time", [&](const Json& v, const std::string& at) { time(v, at, layout); }, true}};
    members.insert(members.begin(), own);
    if (!object(value, pointer, members)) return false;
    layout.format.blanks = separator == "blanks";
    if (layout.format.blanks ||
        (separator.size() == 1 && separator.find_first_of("\"\n\r") == std::string::npos))
      layout.format.separator = separator[0];
    else if (!separator.empty())
      refuse(pointer + "/separator", "must be \"blanks\" or one character, not a quote or line end");
    if (layout.decimal_comma && !layout.format.blanks &&
        (layout.format.separator == ',' || layout.format.separator == '\0'))
      refuse(pointer + "/decimal", "is the separator too: give separator, often \";\"");
    return true;
  }

  JoinedTable joined(const std::string& name, const Json& member, const std::string& here) {
    JoinedTable joined;
    joined.name = name;
    if (name.empty() || name.find(':') != std::string::npos) refuse(here, "must be a name without ':'");
    table(member, here, joined.layout,
          {{"file", into(joined.file), true}, {"tolerance_s", into(joined.tolerance_s)}});
    if (joined.tolerance_s <= 0 || joined.tolerance_s > 1e6)
      refuse(here + "/tolerance_s", "must be above 0 and at most 1000000");
    return joined;
  }

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
