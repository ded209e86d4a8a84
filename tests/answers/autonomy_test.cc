#include "answers/autonomy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "answers/battery_dialects.h"
#include "answers/profile.h"
#include "ingest/forecasts.h"
#include "server/api/robot_json.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::answers {
namespace {

using nlohmann::json;

class AutonomyAnswer : public ::testing::Test {
 protected:
  AutonomyAnswer() {
    robot_ = untried(*model_in_force(testing::nomad(), 3));
    live_.robot_id = "nomad";
    live_.state_of_charge = 0.62;
    live_.sample.utime_us = 1;
    live_.sample.battery_voltage_v = 24.7;
    live_.sample.battery_current_a = 1.5;
    live_.sample.pose = {1, 2, 0};
    live_.sample.payload_kg = 2;
  }

  json ask(const json& request) {
    const auto text = autonomy_answer(request, robot_, api::live_robot(&live_), tables_);
    EXPECT_TRUE(text) << (text ? "" : describe(text.error())) << request;
    return text ? json::parse(*text) : json::object();
  }
  Error fault(const json& request, const ingest::RobotSnapshot* live) {
    const auto text = autonomy_answer(request, robot_, api::live_robot(live), tables_);
    EXPECT_FALSE(text) << request;
    return text ? Error{} : text.error();
  }

  planning::CostTableCache tables_;
  RobotOutlook robot_;
  ingest::RobotSnapshot live_;
};

TEST_F(AutonomyAnswer, DefaultsToTheRobotsState) {
  const json a = ask(json::object());
  EXPECT_EQ(a["model_version"], 3);
  EXPECT_EQ(a["state_of_charge"], 0.62);
  EXPECT_EQ(a["payload_kg"], 2);
  EXPECT_EQ(a["consumption"]["basis"], "model");
  EXPECT_TRUE(a["plan"].is_null());
  EXPECT_LT(a["range_quantiles_m"]["p05"], a["range_m"]);
  EXPECT_LT(a["range_m"], a["range_quantiles_m"]["p95"]);
  EXPECT_NEAR(a["range_m"].get<double>(),
              a["usable_energy_j"].get<double>() / a["consumption"]["energy_per_m_j"].get<double>(),
              1e-6 * a["range_m"].get<double>());
  // A heavier robot goes less far, a slower one at this idle power too.
  EXPECT_LT(ask({{"payload_kg", 10}})["range_m"], a["range_m"]);
  EXPECT_LT(ask({{"speed_m_s", 0.2}})["range_m"], a["range_m"]);
  EXPECT_GT(ask({{"driving", "minimum_energy"}})["range_m"], ask({{"speed_m_s", 0.3}})["range_m"]);
}

// Of all values of time on a grid, those that keep the reserve take no less time.
TEST_F(AutonomyAnswer, FindsFastestDrivingWithinReserve) {
  robot::RobotModel quick = testing::nomad();
  quick.limits.speed_m_s = 3;
  quick.limits.acceleration_m_s2 = quick.limits.yaw_rate_rad_s = 2;
  quick.limits.current_a = 100;
  robot_ = untried(*model_in_force(quick, 3));
  json tasks = json::array();
  for (int k = 0; k < 40; ++k)
    tasks.push_back(
        {{"turns_rad", {k % 2 ? 1.2 : -0.7}}, {"distances_m", {0, 12 + k % 3}}, {"payload_kg", 3}});
  const auto at = [&](double charge, double value_of_time_w, bool fastest = false) {
    return ask({{"tasks", tasks},
                {"driving", "minimum_energy"},
                {"state_of_charge", charge},
                {"confidence", 0.9},
                {"compare_fastest", fastest},
                {"value_of_time_w", value_of_time_w}});
  };
  const auto probability = [](const json& a) { return a["plan"]["success_probability"].get<double>(); };
  // The charges at which the slowest and the fastest driving just keep the reserve.
  const auto needed = [&](double value_of_time_w) {
    double low = 0.1, high = 1;
    for (int k = 0; k < 24; ++k) {
      const double charge = 0.5 * (low + high);
      (probability(at(charge, value_of_time_w)) >= 0.9 ? high : low) = charge;
    }
    return high;
  };
  const double least = needed(0), most = needed(1e6);
  ASSERT_LT(least + 1e-4, most);
  const double charge = 0.5 * (least + most);
  const json a = at(charge, 0, true), &fastest = a["fastest"];
  ASSERT_TRUE(fastest.is_object());
  EXPECT_GE(fastest["success_probability"], 0.9);
  for (int k = -20; k <= 20; ++k) {
    const double value_of_time_w = fastest["value_of_time_w"].get<double>() * std::exp(0.1 * k);
    const json other = at(charge, value_of_time_w);
    if (probability(other) < 0.9) continue;
    EXPECT_GE(other["plan"]["duration_s"].get<double>(), 0.999 * fastest["duration_s"].get<double>()) << k;
  }
  const json same = at(charge, fastest["value_of_time_w"]);
  EXPECT_NEAR(same["plan"]["duration_s"], fastest["duration_s"].get<double>(), 1e-3);
  EXPECT_TRUE(at(least - 1e-3, 0, true)["fastest"].is_null());
  EXPECT_NEAR(at(most + 1e-3, 0, true)["fastest"]["value_of_time_w"], 1e6, 1);
  EXPECT_TRUE(ask({{"tasks", tasks}})["fastest"].is_null());
}

TEST_F(AutonomyAnswer, StatesWhyChargeIsUncertain) {
  live_.charge.estimate.source = battery::ChargeSource::voltage_and_current;
  const auto limitation = [&](const json& request) {
    const json stated = ask(request)["state_of_charge_limitation"];
    return stated.is_null() ? "" : stated.get<std::string>();
  };
  EXPECT_EQ(limitation(json::object()), "");
  live_.charge.estimate.flat_curve = true;
  EXPECT_THAT(limitation(json::object()), ::testing::HasSubstr("counted from the current"));
  live_.charge.estimate.default_curve = true;
  EXPECT_THAT(limitation(json::object()), ::testing::HasSubstr("battery.open_circuit_voltage"));
  EXPECT_EQ(limitation({{"state_of_charge", 0.5}}), "");
  EXPECT_THAT(api::state_table().text({live_, {}, 1}), ::testing::HasSubstr("battery.open_circuit_voltage"));
}

// The robot's state and its energy state on LCM contain this answer, not another one.
TEST_F(AutonomyAnswer, EqualsTheLiveState) {
  testing::PipelineHarness harness;
  ingest::Forecasts forecasts(*harness.store);
  live_.charge.estimate.sd = 0.02;
  for (const double payload_kg : {2.0, 5.0, 2.0}) {
    live_.sample.payload_kg = payload_kg;
    const json a = ask(json::object());
    const std::optional<forecast::Reach> reach = forecasts.reach(robot_.model, live_);
    EXPECT_EQ(reach->range_m[1], a["range_m"]);
    EXPECT_EQ(reach->range_m[0], a["range_quantiles_m"]["p05"]);
    EXPECT_EQ(reach->run_time_s[2], a["run_time_quantiles_s"]["p95"]);
    const std::string state = api::state_table().text({live_, reach, 1});
    EXPECT_EQ(json::parse(state)["range_quantiles_m"], a["range_quantiles_m"]);
  }
  live_.state_of_charge = std::nan("");
  EXPECT_TRUE(std::isnan(forecasts.reach(robot_.model, live_).range_m[1]));
}

TEST_F(AutonomyAnswer, DistanceAloneHasNoPlace) {
  const json charger = {{"x_m", 0}, {"y_m", 0}};
  const json way = {{"distances_m", {10}}}, placed = {{"distances_m", {10}}, {"turns_rad", {0}}};
  EXPECT_EQ(fault({{"state_of_charge", 0.5}, {"tasks", {way}}, {"charger", charger}}, &live_).field,
            "/tasks/0/to_charger_m");
  // It remains unknown for the tasks that follow.
  EXPECT_EQ(fault({{"state_of_charge", 0.5},
                   {"tasks", {placed, {{"distances_m", {10}}, {"to_charger_m", 3}}, placed}},
                   {"charger", charger}},
                  &live_)
                .field,
            "/tasks/2/to_charger_m");
  // Six ways of 10 m, there and back: the way home is as long as stated, not 60 m.
  const auto home = [&](double to_charger_m) {
    json tasks = json::array();
    for (int k = 0; k < 6; ++k) tasks.push_back({{"distances_m", {10}}, {"to_charger_m", to_charger_m}});
    const json a = ask({{"state_of_charge", 0.5}, {"tasks", tasks}, {"to_charger_m", 2}});
    return a["plan"]["charger"]["expected_energy_j"].get<double>();
  };
  const json alone = ask({{"state_of_charge", 0.5}, {"tasks", {{{"distances_m", {20}}}}}});
  EXPECT_NEAR(home(20), alone["plan"]["expected_energy_j"].get<double>(), 0.05 * home(20));
}

TEST_F(AutonomyAnswer, TaskListEndsAtTheCharger) {
  json tasks = json::array();
  for (int k = 0; k < 4; ++k)
    tasks.push_back({{"task_id", "t" + std::to_string(k)},
                     {"turns_rad", {1.57}},
                     {"distances_m", {0, 2000}},
                     {"payload_kg", 2.5 * k},
                     {"dwell_s", 60}});
  const json a = ask({{"state_of_charge", 0.5},
                      {"reserve_fraction", 0.2},
                      {"tasks", tasks},
                      {"charger", {{"x_m", 0}, {"y_m", 0}}},
                      {"confidence", 0.9}});
  const json& plan = a["plan"];
  ASSERT_EQ(plan["legs"].size(), 4u);
  ASSERT_TRUE(plan["charger"].is_object());
  double before = 0, summed = 0;
  for (const json& leg : plan["legs"]) {
    EXPECT_GT(leg["ends_after_s"], before);
    before = leg["ends_after_s"];
    summed += leg["expected_energy_j"].get<double>();
    EXPECT_LE(leg["arrival_charge"]["p05"], leg["arrival_charge"]["p95"]);
  }
  summed += plan["charger"]["expected_energy_j"].get<double>();
  EXPECT_NEAR(summed, plan["expected_energy_j"].get<double>(), 1e-6 * summed);
  EXPECT_EQ(plan["success_probability"], plan["charger"]["success_probability"]);
  // Heavier loads cost more.
  EXPECT_GT(plan["legs"][3]["expected_energy_j"], plan["legs"][0]["expected_energy_j"]);
  ASSERT_TRUE(plan["latest_departure"].is_object());
  EXPECT_GE(plan["latest_departure"]["probability"], 0.9);
  const json& best = a["minimum_energy"];
  ASSERT_TRUE(best.is_object());
  EXPECT_GT(best["saved_j"], 0);
  EXPECT_GE(best["success_probability"], plan["success_probability"]);
}

TEST_F(AutonomyAnswer, IncludesTheChargesUncertainty) {
  live_.charge.estimate.sd = 0.03;
  const json a = ask(json::object());
  EXPECT_EQ(a["state_of_charge_sd"], 0.03);
  EXPECT_GT(a["usable_energy_sd_j"], 0);
  EXPECT_EQ(ask({{"state_of_charge", 0.62}})["state_of_charge_sd"], 0);
}

TEST_F(AutonomyAnswer, ReportsTheChargingTime) {
  EXPECT_TRUE(ask(json::object())["charging"].is_null());
  live_.charge.phase = battery::ChargingPhase::taper;
  live_.charge.to_full = {1800, 200};
  const json a = ask(json::object());
  EXPECT_EQ(a["charging"], "taper");
  EXPECT_EQ(a["time_to_charged_s"], 1800);
  EXPECT_EQ(a["time_to_charged_sd_s"], 200);
  EXPECT_TRUE(ask({{"state_of_charge", 0.3}})["time_to_charged_s"].is_null());  // of another charge
}

TEST_F(AutonomyAnswer, NamesTasksAndPace) {
  const json a = ask({{"state_of_charge", 0.02},
                      {"reserve_fraction", 0},
                      {"tasks", {{{"task_id", "far"}, {"distances_m", {1e5}}}, {{"distances_m", {1}}}}}});
  EXPECT_EQ(a["driving"], "usual");
  EXPECT_GT(a["pace"]["speed_m_s"], 0);
  EXPECT_EQ(a["plan"]["legs"][0]["task_id"], "far");
  EXPECT_EQ(a["plan"]["legs"][1]["task_id"], "");
  EXPECT_EQ(a["plan"]["fails_at"], json({{"task", 0}, {"task_id", "far"}}));
  EXPECT_EQ(ask({{"speed_m_s", 0.3}})["driving"], "stated");
  EXPECT_EQ(fault({{"tasks", {{{"name", "t"}, {"distances_m", {5}}}}}}, &live_).field, "/tasks/0/name");
}

TEST_F(AutonomyAnswer, PathAndDistanceAgree) {
  const json by_path =
      ask({{"state_of_charge", 0.5}, {"tasks", {{{"path", {{{"kind", "straight"}, {"length_m", 30}}}}}}}});
  const json by_distance = ask({{"state_of_charge", 0.5}, {"tasks", {{{"distances_m", {30}}}}}});
  EXPECT_NEAR(by_path["plan"]["expected_energy_j"].get<double>(),
              by_distance["plan"]["expected_energy_j"].get<double>(), 1e-6);
}

// The plan for a deadline equals the plan in free time with the deadline's multiplier as value of time: so
// the chance of any plan of the profile endpoint can be requested.
TEST_F(AutonomyAnswer, ValueOfTimeReproducesADeadline) {
  robot::RobotModel frugal = testing::nomad();  // its standing costs little, so that haste costs much
  frugal.idle_power_w /= 10;
  frugal.limits.speed_m_s *= 2;
  frugal.limits.acceleration_m_s2 *= 2;
  robot_ = untried(*model_in_force(frugal, 1));
  const json path = {{{"kind", "straight"}, {"length_m", 20}},
                     {{"kind", "turn"}, {"angle_rad", 1.5}},
                     {{"kind", "straight"}, {"length_m", 5}}};
  const auto planned = [&](json more) {
    more.update({{"path", path}, {"payload_kg", 2}, {"columns", false}});
    const auto text = profile_answer(more, *robot_.model);
    EXPECT_TRUE(text) << (text ? "" : describe(text.error()));
    return text ? json::parse(*text) : json::object();
  };
  const json free = planned({{"limits", nullptr}});
  const double shortest_s = free["certificate"]["shortest_time_s"];
  const json hasty = planned({{"deadline_s", 0.5 * (free["duration_s"].get<double>() + shortest_s)}});
  ASSERT_LT(hasty["duration_s"].get<double>(), 0.98 * free["duration_s"].get<double>());
  const json a = ask({{"state_of_charge", 0.5},
                      {"payload_kg", 2},
                      {"value_of_time_w", hasty["certificate"]["time_multiplier_w"]},
                      {"tasks", {{{"path", path}}}}});
  const json& best = a["minimum_energy"];
  // The profile meets its deadline to 1e-4 of it; both are solved on the same grids. The forecast's energy is
  // the mean of a skewed distribution, which is higher by about half its relative variance.
  EXPECT_NEAR(best["duration_s"].get<double>(), hasty["duration_s"].get<double>(),
              2e-4 * hasty["duration_s"].get<double>());
  const double energy_j = best["expected_energy_j"];
  EXPECT_GT(energy_j, hasty["energy_j"]);
  const double common = a["consumption"]["common_deviation"], leg = a["consumption"]["leg_deviation"];
  EXPECT_LT(energy_j, hasty["energy_j"].get<double>() * (1 + 0.6 * (common * common + leg * leg)));
  EXPECT_EQ(fault({{"value_of_time_w", -1}}, &live_).field, "/value_of_time_w");
}

// The robot can drive empty, but not with the load of a task.
TEST_F(AutonomyAnswer, RejectsTasksBeyondTheMotors) {
  robot::RobotModel robot = testing::nomad();
  robot.effects.push_back({"load_rolling_resistance", {{"coefficient", 0.05}}});
  const auto needed = [&](double payload_kg) {
    const auto drive = *dynamics::drive_model(robot);
    robot.limits.current_a = 1e-3;
    return forecast::LegPricer(robot, drive)
        .reachable(forecast::Motion::turn, 0, payload_kg, {1, 1})
        .creeping_current_a;
  };
  robot.limits.current_a = 0.5 * (needed(0) + needed(10));
  robot_ = untried(*model_in_force(robot, 3));
  for (const char* driving : {"usual", "minimum_energy"}) {
    const json answer = ask(
        {{"payload_kg", 0}, {"driving", driving}, {"tasks", {{{"distances_m", {5}}, {"payload_kg", 10}}}}});
    EXPECT_TRUE(answer["plan"].is_null()) << driving;
    EXPECT_NE(answer["pace"]["limitation"].get<std::string>().find("With 10 kg the robot cannot"),
              std::string::npos)
        << answer["pace"];
  }
}

TEST_F(AutonomyAnswer, FaultsNameTheField) {
  EXPECT_EQ(fault(json::object(), nullptr).field, "/state_of_charge");
  EXPECT_EQ(fault(json::object(), nullptr).fault, Fault::infeasible);
  EXPECT_EQ(fault({{"tasks", {{{"distances_m", {5}}, {"payload_kg", 99}}}}}, &live_).field,
            "/tasks/0/payload_kg");
  EXPECT_EQ(fault({{"tasks", {{{"distances_m", {-5}}}}}}, &live_).field, "/tasks/0/distances_m/0");
  EXPECT_EQ(fault({{"tasks", {{{"no", 1}}}}}, &live_).field, "/tasks/0/no");
  const Error empty = fault({{"tasks", {{{"distances_m", {5}}}, json::object()}}}, &live_);
  EXPECT_EQ(empty.field, "/tasks/1/path");
  EXPECT_EQ(
      empty.message,
      "is required where none of distances_m, turns_rad, pickup, dwell_s, turn_rad, distance_m is given: a "
      "task drives or stands");
  EXPECT_EQ(fault({{"tasks", {{{"task_id", "t"}, {"payload_kg", 5}}}}}, &live_).field, "/tasks/0/path");
  EXPECT_EQ(fault({{"tasks", {{{"path", json::array()}}}}}, &live_).field, "/tasks/0/path");
  EXPECT_EQ(fault({{"tasks", {{{"dropoff", {{"x_m", 1}, {"y_m", 2}}}}}}}, &live_).field, "/tasks/0/pickup");
  EXPECT_EQ(fault({{"tasks", {{{"turns_rad", {90}}}}}}, &live_).field, "/tasks/0/turns_rad/0");
  EXPECT_EQ(fault({{"tasks", {{{"path", {{{"kind", "turn"}, {"angle_rad", -13}}}}}}}}, &live_).field,
            "/tasks/0/path/0/angle_rad");
  EXPECT_EQ(fault({{"dialect", "klingon"}}, &live_).field, "/dialect");
  EXPECT_EQ(fault({{"confidence", 1}}, &live_).field, "/confidence");
  EXPECT_EQ(fault({{"to_charger_m", 5}, {"tasks", {{{"distances_m", {5}}}}}}, &live_).field,
            "/tasks/0/to_charger_m");
  EXPECT_EQ(fault({{"charger", {{"x_m", 0}}}}, &live_).field, "/charger/y_m");
}

// The rules below are those of the standards' published schemas: VDA 5050 3.0 state.powerSupply, VDA 5050 2.1
// state.batteryState, MassRobotics AMR Interoperability 1.0 statusReport, ROS 2 sensor_msgs/msg/BatteryState.
class BatteryDialect : public AutonomyAnswer {
 protected:
  json in(const char* dialect) { return ask({{"dialect", dialect}}); }
};

TEST_F(BatteryDialect, Vda5050Version3HasPercent) {
  const json d = in("vda5050-3.0");
  ASSERT_EQ(d.size(), 1u);
  const json& s = d["powerSupply"];
  EXPECT_NEAR(s["stateOfCharge"].get<double>(), 62, 1e-12);
  EXPECT_EQ(s["batteryVoltage"], 24.7);
  EXPECT_EQ(s["batteryCurrent"], -1.5);
  EXPECT_EQ(s["charging"], false);
  EXPECT_EQ(s["range"].get<double>(),
            std::floor(ask(json::object())["range_quantiles_m"]["p05"].get<double>()));
  EXPECT_FALSE(s.contains("batteryHealth"));  // unknown: left out, never 0
  for (const auto& [key, value] : s.items())
    EXPECT_TRUE(std::set<std::string>({"stateOfCharge", "batteryVoltage", "batteryCurrent", "batteryHealth",
                                       "charging", "range"})
                    .contains(key))
        << key;
}

TEST_F(BatteryDialect, Version2HasWholeMetres) {
  const json d = in("vda5050-2.1");
  ASSERT_EQ(d.size(), 1u);
  const json& s = d["batteryState"];
  EXPECT_NEAR(s["batteryCharge"].get<double>(), 62, 1e-12);
  EXPECT_EQ(s["charging"], false);
  ASSERT_TRUE(s["reach"].is_number_integer());  // uint32
  EXPECT_EQ(s["reach"].get<double>(),
            std::floor(ask(json::object())["range_quantiles_m"]["p05"].get<double>()));
  EXPECT_FALSE(s.contains("stateOfCharge"));
  EXPECT_FALSE(s.contains("range"));
}

TEST_F(BatteryDialect, MassRoboticsHasPercentAndHours) {
  const json d = in("massrobotics");
  EXPECT_EQ(d.size(), 2u);
  EXPECT_NEAR(d["batteryPercentage"].get<double>(), 62, 1e-12);
  const double run_time_s = ask(json::object())["run_time_quantiles_s"]["p05"];
  EXPECT_LE(d["remainingRunTime"].get<double>() * 3600, run_time_s);
  EXPECT_GT(d["remainingRunTime"].get<double>() * 3600, run_time_s - 3.7);  // a thousandth of an hour
}

TEST_F(BatteryDialect, RosHasFractionAndNegativeDischarge) {
  const json d = in("ros");
  for (const char* field :
       {"voltage", "temperature", "current", "charge", "capacity", "design_capacity", "percentage",
        "power_supply_status", "power_supply_health", "power_supply_technology", "present", "cell_voltage",
        "cell_temperature", "location", "serial_number"})
    EXPECT_TRUE(d.contains(field)) << field;
  EXPECT_EQ(d.size(), 15u);
  EXPECT_EQ(d["percentage"], 0.62);
  EXPECT_EQ(d["current"], -1.5);
  EXPECT_NEAR(d["charge"].get<double>(), 0.62 * 18, 1e-12);
  EXPECT_EQ(d["design_capacity"], 18);
  EXPECT_EQ(d["power_supply_status"], 2);   // DISCHARGING
  EXPECT_TRUE(d["temperature"].is_null());  // NaN
}

TEST_F(BatteryDialect, ChargingTurnsSignAndStatus) {
  live_.sample.battery_current_a = -4;
  EXPECT_EQ(in("vda5050-3.0")["powerSupply"]["charging"], true);
  EXPECT_EQ(in("vda5050-3.0")["powerSupply"]["batteryCurrent"], 4);
  EXPECT_EQ(in("vda5050-2.1")["batteryState"]["charging"], true);
  EXPECT_EQ(in("ros")["power_supply_status"], 1);  // CHARGING
  EXPECT_EQ(in("ros")["current"], 4);
  live_.speed_m_s = 0.5;  // braking, not charging
  EXPECT_EQ(in("vda5050-3.0")["powerSupply"]["charging"], false);
  live_.charge.phase = battery::ChargingPhase::taper;
  EXPECT_EQ(in("vda5050-3.0")["powerSupply"]["charging"], true);
  live_.charge.phase = battery::ChargingPhase::full;
  EXPECT_EQ(in("ros")["power_supply_status"], 4);  // FULL
  EXPECT_EQ(in("vda5050-2.1")["batteryState"]["charging"], false);
}

TEST_F(BatteryDialect, RoundsToTheBatterysDigits) {
  live_.state_of_charge = 2.0 / 3;
  live_.sample.battery_voltage_v = 24.70049;
  live_.sample.battery_current_a = 1.00061;
  const json s = in("vda5050-3.0")["powerSupply"];
  EXPECT_EQ(s["stateOfCharge"], 66.67);
  EXPECT_EQ(s["batteryVoltage"], 24.7);
  EXPECT_EQ(s["batteryCurrent"], -1.001);
  EXPECT_EQ(in("vda5050-2.1")["batteryState"]["batteryCharge"], 66.67);
  EXPECT_EQ(in("massrobotics")["batteryPercentage"], 66.67);
  EXPECT_EQ(in("ros")["percentage"], 0.6667);
  EXPECT_EQ(in("ros")["charge"], 12);
  live_.state_of_charge = 1.0001;  // the filter may overshoot, percentages may not
  EXPECT_EQ(in("vda5050-2.1")["batteryState"]["batteryCharge"], 100);
}

TEST_F(BatteryDialect, UnmeasuredValuesAreNeverZero) {
  live_.sample.battery_current_a = live_.sample.battery_voltage_v = std::nan("");
  EXPECT_FALSE(in("vda5050-3.0")["powerSupply"].contains("batteryCurrent"));
  EXPECT_TRUE(in("ros")["current"].is_null());
  EXPECT_EQ(in("ros")["power_supply_status"], 0);  // UNKNOWN
  EXPECT_GT(in("ros")["voltage"], 20);             // mandatory: the model's
}

}  // namespace
}  // namespace joulecast::answers
