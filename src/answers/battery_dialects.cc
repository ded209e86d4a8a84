#include "answers/battery_dialects.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include "battery/circuit.h"
#include "describe/table.h"

namespace joulecast::answers {
namespace {

constexpr double least_current_share = 0.01;  // of the capacity, an hour: weaker currents are no charging
constexpr int ros_lithium_ion = 2, ros_iron_phosphate = 4;

// Constants of sensor_msgs/BatteryState.
enum RosStatus { ros_unknown = 0, ros_charging = 1, ros_discharging = 2, ros_not_charging = 3, ros_full = 4 };
constexpr int ros_health_unknown = 0, ros_health_good = 1;

constexpr double good_health = 0.7;
constexpr double longest_reach_m = 4294967295;  // VDA 5050 2.1: an unsigned integer of 32 bits

// To `digits` places; further ones are below the accuracy of batteries.
double rounded(double value, int digits) {
  const double scale = std::pow(10.0, digits);
  return std::round(value * scale) / scale + 0.0;  // no negative zero
}
// A promised range or run time is not rounded up.
double promised(double value, int digits) {
  const double scale = std::pow(10.0, digits);
  return std::floor(value * scale) / scale;
}

double percent(double fraction) {
  return rounded(std::clamp(100 * fraction, 0.0, 100.0), 2);
}

constexpr int milli = 3;

using described::Schema;
using described::Table;

const Schema percentage{{"minimum", 0}, {"maximum", 100}}, at_least_0{{"minimum", 0}};
constexpr const char* range_words =
    "m; the 5 % quantile, exceeded in 19 of 20 cases: range_quantiles_m.p05 of the state, where range_m is "
    "the median";

double charge_percent(const BatteryStatus& s) {
  return percent(s.charge);
}
double health_percent(const BatteryStatus& s) {
  return std::isfinite(s.health) ? percent(s.health) : s.health;
}
double voltage_v(const BatteryStatus& s) {
  return rounded(s.voltage_v, milli);
}
double charging_current_a(const BatteryStatus& s) {
  return rounded(-s.current_a, milli);
}
double capacity_ah(const BatteryStatus& s) {
  return s.rated_capacity_ah * (std::isfinite(s.health) ? s.health : 1);
}

int ros_status(const BatteryStatus& s) {
  if (s.full) return ros_full;
  if (s.charging) return ros_charging;
  if (!std::isfinite(s.current_a)) return ros_unknown;
  return s.current_a > 0 ? ros_discharging : ros_not_charging;
}

const auto supply_table =
    Table<BatteryStatus>()
        .value("stateOfCharge", charge_percent, "percent", percentage)
        .known("batteryVoltage", voltage_v, "V")
        .known("batteryCurrent", charging_current_a, "A, negative while discharging")
        .known("batteryHealth", health_percent, "percent", percentage)
        .value("charging", AT(charging), "whether it charges")
        .known(
            "range", [](const BatteryStatus& s) { return promised(s.range_m, 0); }, range_words, at_least_0);
const auto vda5050_3_0_table = Table<BatteryStatus>({}, "VDA 5050 3.0")
                                   .object("powerSupply", std::identity(), "VDA 5050 3.0", supply_table);

const auto battery_state_table =
    Table<BatteryStatus>()
        .value("batteryCharge", charge_percent, "percent", percentage)
        .known("batteryVoltage", voltage_v, "V")
        .value(
            "batteryHealth",
            [](const BatteryStatus& s) { return static_cast<std::int64_t>(std::floor(percent(s.health))); },
            "percent", percentage)
        .only([](const BatteryStatus& s) { return std::isfinite(s.health); })
        .value("charging", AT(charging), "whether it charges")
        .value(
            "reach",
            [](const BatteryStatus& s) {
              return static_cast<std::int64_t>(promised(std::min(s.range_m, longest_reach_m), 0));
            },
            range_words, at_least_0)
        .only([](const BatteryStatus& s) { return std::isfinite(s.range_m); });
const auto vda5050_2_1_table =
    Table<BatteryStatus>({}, "VDA 5050 2.1")
        .object("batteryState", std::identity(), "VDA 5050 2.1", battery_state_table);

const auto massrobotics_table =
    Table<BatteryStatus>({}, "MassRobotics status report")
        .value("batteryPercentage", charge_percent, "percent", percentage)
        .known(
            "remainingRunTime", [](const BatteryStatus& s) { return promised(s.run_time_s / 3600, milli); },
            "hours; exceeded in 19 of 20 cases", at_least_0);

constexpr auto no_cells = [](const BatteryStatus&) { return std::vector<double>(); };
constexpr auto no_text = [](const BatteryStatus&) { return ""; };
const auto ros_table =
    Table<BatteryStatus>({}, "ROS sensor_msgs/BatteryState, with null in place of NaN")
        .number_or_null("voltage", voltage_v, "V")
        .number_or_null(
            "temperature", [](const BatteryStatus&) { return std::nan(""); }, "degrees Celsius")
        .number_or_null("current", charging_current_a, "A, negative while discharging")
        .number_or_null(
            "charge", [](const BatteryStatus& s) { return rounded(s.charge * capacity_ah(s), milli); }, "Ah")
        .number_or_null(
            "capacity", [](const BatteryStatus& s) { return rounded(capacity_ah(s), milli); }, "Ah, present")
        .number_or_null("design_capacity", AT(rated_capacity_ah), "Ah, rated")
        .number_or_null("percentage", [](const BatteryStatus& s) { return rounded(s.charge, 4); }, "0 to 1",
                        {{"minimum", 0}, {"maximum", 1}})
        .value("power_supply_status", ros_status,
               "sensor_msgs/BatteryState: 0 unknown, 1 charging, 2 discharging, 3 not charging, 4 full",
               {{"minimum", 0}, {"maximum", 4}})
        .value("power_supply_health",
               [](const BatteryStatus& s) {
                 return std::isfinite(s.health) && s.health >= good_health ? ros_health_good
                                                                           : ros_health_unknown;
               },
               "sensor_msgs/BatteryState: 1 good, 0 unknown", {{"minimum", 0}, {"maximum", 8}})
        .value("power_supply_technology", AT(ros_technology),
               "sensor_msgs/BatteryState: 0 unknown, 1 NiMH, 2 Li-ion, 3 LiPo, 4 LiFePO4, 5 NiCd, 6 LiMn",
               {{"minimum", 0}, {"maximum", 7}})
        .value(
            "present", [](const BatteryStatus&) { return true; }, "whether a battery is present")
        .column("cell_voltage", no_cells, "empty: no cell data", milli, true)
        .column("cell_temperature", no_cells, "empty: no cell data", milli, true)
        .value("location", no_text, "empty: not available")
        .value("serial_number", no_text, "empty: not available");

// Of each Dialect but this service's own.
constexpr const Table<BatteryStatus>* dialect_tables[] = {nullptr, &vda5050_3_0_table, &vda5050_2_1_table,
                                                          &massrobotics_table, &ros_table};
static_assert(std::size(dialect_tables) == std::size(dialect_names));

}  // namespace

BatteryStatus battery_status(const robot::Battery& battery, const forecast::ChargeMap& map,
                             const forecast::Charge& charge, const forecast::Reach& reach,
                             const LiveRobot& now) {
  BatteryStatus s;
  s.charge = charge.fraction;
  s.health = battery.ageing_factor.value_or(std::nan(""));
  s.rated_capacity_ah = battery.capacity_ah;
  s.voltage_v = now.battery_voltage_v;
  s.current_a = now.battery_current_a;
  // Regeneration is not charging: the service's detected phase counts, and before it has one, the current of
  // a robot that stands.
  const battery::ChargingPhase phase = now.charging;
  const double weak_a = least_current_share * battery.capacity_ah;
  const bool standing = !(std::fabs(now.speed_m_s) > 0);
  s.full = phase == battery::ChargingPhase::full;
  s.charging = phase == battery::ChargingPhase::constant_current || phase == battery::ChargingPhase::taper ||
               (phase != battery::ChargingPhase::full && standing && s.current_a < -weak_a);
  if (!std::isfinite(s.voltage_v))
    s.voltage_v = map.circuit().inner_voltage_v(battery::Circuit::rested(s.charge));
  s.range_m = reach.range_m[0];
  s.run_time_s = reach.run_time_s[0];
  const std::string_view chemistry = battery::likeliest_cell(battery.nominal_voltage_v).chemistry;
  if (chemistry.find("phosphate") != std::string_view::npos) {
    s.ros_technology = ros_iron_phosphate;
  } else if (chemistry.find("lithium") != std::string_view::npos) {
    s.ros_technology = ros_lithium_ion;
  }
  return s;
}

described::Schema battery_status_schema() {
  Schema forms = Schema::array();
  for (const Table<BatteryStatus>* table : dialect_tables)
    if (table != nullptr) forms.push_back(table->of_member());
  return {{"title", "Battery message of another standard"}, {"anyOf", std::move(forms)}};
}

std::string battery_dialect(Dialect dialect, const BatteryStatus& status) {
  const Table<BatteryStatus>* table = dialect_tables[static_cast<std::size_t>(dialect)];
  return table != nullptr ? table->text(status) : "{}";
}

}  // namespace joulecast::answers
