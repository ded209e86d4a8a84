// Lists and sums of missions that filters choose.
#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <utility>

#include "answers/mission.h"
#include "base/try.h"
#include "robot/robot_fields.h"
#include "server/api/common_parameters.h"
#include "server/api/services.h"
#include "signals/ledger.h"

namespace joulecast::api {
namespace {

using history::MissionOrder;
using Type = Parameter::Type;

// In the order of MissionOrder.
constexpr std::array<std::string_view, 12> orders{"start",    "robot",    "mission",   "state",
                                                  "duration", "distance", "payload",   "energy",
                                                  "modelled", "ratio",    "wh_per_km", "charge"};
static_assert(static_cast<MissionOrder>(orders.size() - 1) == MissionOrder::charge);

Result<history::MissionFilter> filter_of(const Request& request) {
  history::MissionFilter filter;
  TRY_ASSIGN(filter.robot_ids, robot_ids_of(request));
  if (const auto mission = request.query_value("mission_id")) filter.mission_id = std::string(*mission);
  if (const auto part = request.query_value("name_contains")) filter.name_contains = std::string(*part);
  TRY_ASSIGN(filter.started, range_of(request));
  filter.incomplete = request.query_boolean("incomplete");
  filter.payload_min_kg = request.query_number("payload_min_kg");
  filter.payload_max_kg = request.query_number("payload_max_kg");
  filter.ratio_min = request.query_number("ratio_min");
  filter.ratio_max = request.query_number("ratio_max");
  if (const auto state = request.query_value("state"))
    filter.states.push_back(*history::from_name<history::MissionState>(*state));
  return filter;
}

std::vector<Parameter> filter_parameters() {
  const auto& state_names = history::names_of<history::MissionState>;
  return with(
      range_parameters("missions that started"),
      {
          {.name = "robot_id",
           .description = "only missions of this robot, or of these, separated by commas"},
          {.name = "mission_id", .description = "only missions that the robot called so"},
          {.name = "name_contains",
           .description = "only missions with this text within mission_id; ASCII letters in any case"},
          {.name = "state",
           .description = "only missions in this state",
           .choices = {std::begin(state_names), std::end(state_names)}},
          {.name = "incomplete",
           .type = Type::boolean,
           .description = "only missions with (true) or without (false) unmeasured parts"},
          bounded(Type::number, "payload_min_kg", "only missions with at least this payload", 0),
          bounded(Type::number, "payload_max_kg", "only missions with at most this payload", 0),
          bounded(Type::number, "ratio_min",
                  "only missions with at least this ratio of measured to modelled energy"),
          bounded(Type::number, "ratio_max",
                  "only missions with at most this ratio of measured to modelled energy"),
      });
}

std::vector<Parameter> sort_parameters() {
  return {{.name = "sort",
           .description = "sort key, default start; missions without a value come last",
           .choices = {orders.begin(), orders.end()}},
          {.name = "order",
           .description = "asc: least, oldest or first in the alphabet first; desc if absent",
           .choices = {"asc", "desc"}}};
}

history::MissionSort sort_of(const Request& request) {
  history::MissionSort sort;
  sort.ascending = request.query_value("order") == "asc";
  if (const auto by = request.query_value("sort"))  // one of the choices
    sort.by = static_cast<MissionOrder>(std::ranges::find(orders, *by) - orders.begin());
  return sort;
}

// The columns that missions and sums over them have in common, behind a blank.
const std::string account_columns =
    " ratio wh_per_km energy/battery_j energy/measured_j energy/measured_s energy/modelled_j "
    "energy/unexplained_j energy/drawn_j energy/returned_j energy/charge_ah energy/distance_m "
    "energy/turned_rad energy/duration_s samples gap_count gap_s";

Result<Response> list_missions(const Services& services, const Request& request) {
  TRY_ASSIGN(const history::MissionFilter filter, filter_of(request));
  TRY_ASSIGN(history::MissionPage found, services.store.missions(filter, page_of(request), sort_of(request)));
  if (request.csv)
    return csv_response(request, "missions",
                        "id robot_id mission_id state incomplete incomplete_reason start end start_utime_us "
                        "end_utime_us payload_kg model_version" +
                            account_columns + " annulled? note",
                        found.missions, answers::mission_table(), found.next_cursor);
  return page_response("missions", found.missions, answers::mission_table(), found.next_cursor);
}

// Missions that are summed together.
struct Group {
  std::vector<std::string> robot_ids;                      // by robot or kind
  std::optional<std::int64_t> from_utime_us, to_utime_us;  // by day or week
  history::Totals totals;
};

// Robots of one kind together; those without a model are one more kind.
Result<std::vector<Group>> groups_by_kind(const Services& services, history::MissionFilter filter) {
  TRY_ASSIGN(const auto robots, services.store.grouped_totals(filter, history::Grouping::robot, 0));
  std::map<std::string, std::vector<std::string>> ids_of;
  for (const history::TotalsGroup& each : robots) {
    const auto model = services.models.find(each.robot_id);
    ids_of[model != nullptr ? robot::kind_of(model->robot) : ""].push_back(each.robot_id);
  }
  std::vector<Group> groups;
  for (auto& [kind, ids] : ids_of) {
    filter.robot_ids = ids;
    TRY_ASSIGN(const history::Totals totals, services.store.totals(filter));
    groups.push_back({std::move(ids), std::nullopt, std::nullopt, totals});
  }
  return groups;
}

struct Grouped {
  std::string_view name;
  std::optional<history::Grouping> by;  // absent: by kind, which the store does not know
  std::int64_t days;
};
constexpr std::array<Grouped, 6> groupings{{{"robot", history::Grouping::robot, 0},
                                            {"day", history::Grouping::day, 1},
                                            {"week", history::Grouping::week, 7},
                                            {"kind", std::nullopt, 0},
                                            {"robot,day", history::Grouping::robot_day, 1},
                                            {"robot,week", history::Grouping::robot_week, 7}}};

std::vector<std::string> grouping_names() {
  std::vector<std::string> names;
  for (const Grouped& each : groupings) names.emplace_back(each.name);
  return names;
}

Result<std::vector<Group>> groups_of(const Services& services, const Request& request,
                                     const history::MissionFilter& filter) {
  const auto by = request.query_value("group_by");
  if (!by) return std::vector<Group>{};
  const Grouped& as = *std::ranges::find(groupings, *by, &Grouped::name);
  if (!as.by) return groups_by_kind(services, filter);
  TRY_ASSIGN(const auto found, services.store.grouped_totals(
                                   filter, *as.by, 60 * request.query_integer("utc_offset_min").value_or(0)));
  std::vector<Group> groups;
  for (const history::TotalsGroup& each : found) {
    Group& group = groups.emplace_back();
    group.totals = each.totals;
    if (!each.robot_id.empty()) group.robot_ids = {each.robot_id};
    if (as.days == 0) continue;
    group.from_utime_us = each.from_utime_us;
    group.to_utime_us = each.from_utime_us + as.days * 86'400'000'000;
  }
  return groups;
}

const auto totals_table =
    Table<history::Totals>()
        .value("missions", AT(missions), "selected missions, without annulled ones")
        .value("measured_missions", AT(measured_missions), "of these, missions with measured energy")
        .value("incomplete_missions", AT(incomplete_missions), "of these, missions with unmeasured parts")
        .value("samples", AT(samples), "samples of these missions")
        .value("gap_count", AT(gap_count), "gaps in the telemetry")
        .value("gap_s", AT(gap_s), "time without telemetry")
        .number_or_null(
            "ratio", [](const auto& t) { return signals::energy_ratio(t.accounts); },
            "measured over modelled energy during measurement; null: not measured")
        .number_or_null(
            "wh_per_km", [](const auto& t) { return signals::energy_per_distance_wh_km(t.accounts); },
            "battery energy over distance; null below 0.1 m")
        .object("energy", AT(accounts), {}, answers::accounts_table(), true)
        .object("ledger", AT(accounts), "energy by term", answers::ledger_table(), true);

struct TotalsAnswer {
  history::Totals all;
  std::optional<std::vector<Group>> groups;
};

constexpr std::string_view time_words = "of the day or week; null by robot or kind alone";
const auto group_table =
    Table<Group>()
        .texts("robots", AT(robot_ids), "robots of the group, if grouped by robot or kind; else empty")
        .time("from", AT(from_utime_us), time_words)
        .time("to", AT(to_utime_us), time_words)
        .include(totals_table, AT(totals), "as above, of this group");

const auto totals_answer_table =
    Table<TotalsAnswer>("Sums over missions; null where no mission measured")
        .include(totals_table, AT(all))
        .list("groups", AT(groups), "the sums of each group that has missions; null without group_by",
              group_table);

Result<Response> totals(const Services& services, const Request& request) {
  TRY_ASSIGN(const history::MissionFilter filter, filter_of(request));
  TRY_ASSIGN(history::Totals all, services.store.totals(filter));
  TRY_ASSIGN(const std::vector<Group> groups, groups_of(services, request, filter));
  const bool grouped = request.query_value("group_by").has_value();
  if (request.csv)
    return csv_response(request, "mission-totals",
                        "robots from to missions measured_missions incomplete_missions" + account_columns,
                        grouped ? groups : std::vector<Group>{{{}, {}, {}, all}}, group_table);
  const TotalsAnswer answer{all, grouped ? std::optional(groups) : std::nullopt};
  return http::json_response(totals_answer_table.text(answer));
}

const auto tariff_table =
    Table<Tariff>("Price and emissions of a kilowatt hour")
        .number_or_null("price_per_kwh", AT(price_per_kwh), "setting energy.price_per_kwh; null: not set")
        .value("currency", AT(currency), "setting energy.currency")
        .number_or_null("co2_g_per_kwh", AT(co2_g_per_kwh),
                        "setting energy.co2_g_per_kwh, grams; null: not set");

Result<Response> tariff(const Services& services, const Request&) {
  return http::json_response(tariff_table.text(services.tariff));
}

}  // namespace

Part mission_list_part() {
  Part part;
  part.add(
      Method::get, "/v1/missions", "listMissions", Role::read,
      "Missions, newest first or sorted, in pages that stay stable while missions come",
      {"mission-page", described::of_page("A page of missions", "missions", "missions in the requested order",
                                          answers::mission_table().of_member())},
      list_missions,
      {.parameters =
           with(with(filter_parameters(), sort_parameters()),
                {limit_parameter("missions a page", 50, history::max_page_size), cursor_parameter()}),
       .csv = true,
       .rounded = true});
  part.add(
      Method::get, "/v1/mission-totals", "totalMissions", Role::read,
      "Sums of energy and ledger over the selected missions, optionally by group",
      {"mission-totals", totals_answer_table.schema()}, totals,
      {.parameters = with(
           filter_parameters(),
           {{.name = "group_by",
             .description =
                 "also the sums of each robot, day, week or kind of robot, or of each robot by day or week",
             .choices = grouping_names()},
            bounded(Type::integer, "utc_offset_min",
                    "days begin at midnight, weeks on Monday, of a clock so many minutes ahead of UTC; 0 if "
                    "absent",
                    -1440, 1440)}),
       .csv = true,
       .rounded = true});
  part.add(Method::get, "/v1/tariff", "getTariff", Role::read,
           "Price and emissions of a kilowatt hour, by which the page values energy",
           {"tariff", tariff_table.schema()}, tariff);
  return part;
}

}  // namespace joulecast::api
