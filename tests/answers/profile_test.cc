#include "answers/profile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "answers/autonomy.h"
#include "answers/estimate.h"
#include "robot/robot_file.h"
#include "tests/support/sample_robots.h"

namespace joulecast::answers {
namespace {

using nlohmann::json;

Result<std::string> estimated(const json& request, const ModelInForce& model) {
  return estimate_answer(request, untried(std::make_shared<const ModelInForce>(model)));
}

ModelInForce model() {
  return **model_in_force(testing::nomad(), 3);
}

json answer(Result<std::string> (*question)(const json&, const ModelInForce&), const json& request) {
  const auto text = question(request, model());
  EXPECT_TRUE(text) << describe(text.error());
  return text ? json::parse(*text) : json();
}

Error fault(Result<std::string> (*question)(const json&, const ModelInForce&), const json& request) {
  const auto text = question(request, model());
  EXPECT_FALSE(text) << *text;
  return text ? Error{} : text.error();
}

// Out empty, loaded after a stop, back: payload and dwell are segments like any other, and profile and
// estimate price them alike.
TEST(Profile, HandlesPayloadChangesAndDwells) {
  const auto straight = [](double m) { return json{{"kind", "straight"}, {"length_m", m}}; };
  const json errand = {
      straight(3), {{"kind", "dwell"}, {"duration_s", 12}},  {{"kind", "payload"}, {"payload_kg", 8}},
      straight(4), {{"kind", "payload"}, {"payload_kg", 0}}, {{"kind", "dwell"}, {"duration_s", 5}}};
  const json whole = answer(profile_answer, {{"path", errand}});
  const json out = answer(profile_answer, {{"path", {straight(3)}}});
  const json back = answer(profile_answer, {{"path", {straight(4)}}, {"payload_kg", 8}});
  const double idle_j = 17 * testing::nomad().idle_power_w;
  const double sum = out["energy_j"].get<double>() + back["energy_j"].get<double>() + idle_j;
  EXPECT_NEAR(whole["energy_j"].get<double>(), sum, 1e-9 * sum);
  EXPECT_NEAR(whole["duration_s"].get<double>(),
              out["duration_s"].get<double>() + back["duration_s"].get<double>() + 17, 1e-9);
  const auto payloads = whole["profile"]["payload_kg"].get<std::vector<double>>();
  EXPECT_EQ(payloads.front(), 0);
  EXPECT_EQ(*std::max_element(payloads.begin(), payloads.end()), 8);
  EXPECT_EQ(payloads.back(), 0);
  const json estimate = answer(estimated, {{"path", errand}});
  EXPECT_EQ(estimate["energy_j"], whole["energy_j"]);
  EXPECT_FALSE(estimate.contains("profile"));
}

// A payload that turns with the robot: as much yaw inertia in the robot itself and the payload a point costs
// the same, and what the file does not state is 0.02 m2 a kilogram.
TEST(Profile, PayloadsHaveYawInertia) {
  const auto turn_j = [](std::optional<double> of_payload_m2, double added_kg_m2) {
    robot::RobotModel robot = testing::nomad();
    robot.limits.payload_kg = 400;
    robot.mass.payload_yaw_inertia_m2 = of_payload_m2;
    robot.mass.yaw_inertia_kg_m2 += added_kg_m2;
    const json request = {
        {"path", {{{"kind", "turn"}, {"angle_rad", 2}}}}, {"payload_kg", 40}, {"regeneration", 0.3}};
    const auto model = *model_in_force(*robot::read_robot(robot::robot_to_json(robot)), 1);
    return json::parse(*profile_answer(request, *model))["energy_j"].get<double>();
  };
  for (const auto& [of_payload_m2, added_kg_m2] :
       {std::pair<std::optional<double>, double>{std::nullopt, 0.8}, {0.0, 0.0}, {0.17, 6.8}}) {
    const double in_robot_j = turn_j(0, added_kg_m2);
    EXPECT_NEAR(turn_j(of_payload_m2, 0), in_robot_j, 1e-9 * in_robot_j);
  }
  EXPECT_GT(turn_j(0.17, 0), 1.05 * turn_j(std::nullopt, 0));
}

TEST(Profile, ColumnsEndAtTheirTotals) {
  const json request = {{"path",
                         {{{"kind", "straight"}, {"length_m", 3}},
                          {{"kind", "turn"}, {"angle_rad", 1}},
                          {{"kind", "dwell"}, {"duration_s", 2}},
                          {{"kind", "arc"}, {"radius_m", 1}, {"angle_rad", -1}}}},
                        {"regeneration", 0.4},
                        {"baseline_columns", true}};
  const json a = answer(profile_answer, request);
  for (const json& motion : {a, a["baselines"]["trapezoid"], a["baselines"]["triangle"]}) {
    const json& columns = motion["profile"];
    const double energy = motion["energy_j"].get<double>();
    EXPECT_NEAR(columns["energy_j"].back().get<double>(), energy, 1e-9 * energy);
    EXPECT_NEAR(columns["time_s"].back().get<double>(), motion["duration_s"].get<double>(), 1e-5);
    const auto times = columns["time_s"].get<std::vector<double>>();
    EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
    for (const char* name : {"speed_m_s", "yaw_rate_rad_s", "power_w", "energy_j"})
      EXPECT_EQ(columns[name].size(), times.size()) << name;
  }
  // A baseline is as long on every run, so as long in all.
  EXPECT_NEAR(a["baselines"]["triangle"]["duration_s"].get<double>(), a["duration_s"].get<double>(), 1e-9);
  const json plain = answer(profile_answer, {{"path", request["path"]}});
  EXPECT_FALSE(plain["baselines"]["triangle"].contains("profile"));

  // A given motion: its columns are integrated by another rule than its energy.
  const json motion = {
      {"time_s", {0, 2, 6, 8}}, {"speed_m_s", {0, 0.6, 0.6, 0}}, {"yaw_rate_rad_s", {0, 0, 0.4, 0}}};
  const json e = answer(estimated, {{"profile", motion}, {"columns", true}, {"payload_kg", 4}});
  const double energy = e["energy_j"].get<double>();
  EXPECT_NEAR(e["profile"]["energy_j"].back().get<double>(), energy, 1e-4 * energy);
  EXPECT_NEAR(e["profile"]["distance_m"].back().get<double>(), e["distance_m"].get<double>(), 1e-6);
  EXPECT_TRUE(e["profile"]["x_m"][0].is_null());
  const json placed = answer(
      estimated,
      {{"profile", motion}, {"columns", true}, {"start_pose", {{"x_m", 1}, {"y_m", 2}, {"heading_rad", 0}}}});
  EXPECT_EQ(placed["profile"]["x_m"][0], 1);
}

TEST(Profile, SlowsBaselinesToTheLimits) {
  json request = {{"path", {{{"kind", "straight"}, {"length_m", 8}}}}, {"baseline_columns", true}};
  const double shortest = answer(profile_answer, request)["certificate"]["shortest_time_s"];
  request["deadline_s"] = 1.05 * shortest;
  const json triangle = answer(profile_answer, request)["baselines"]["triangle"];
  EXPECT_FALSE(triangle["within_limits"]);
  const double multiple =
      triangle["slowed"]["duration_s"].get<double>() / triangle["duration_s"].get<double>();
  const double speed = triangle["peak_speed_m_s"].get<double>() / multiple;
  EXPECT_NEAR(speed, testing::nomad().limits.speed_m_s / 1.001, 1e-6);
  const json brief = {{"path", {{{"kind", "straight"}, {"length_m", 0.5}}}}, {"baseline_columns", true}};
  EXPECT_TRUE(answer(profile_answer, brief)["baselines"]["triangle"]["slowed"].is_null());
}

TEST(Estimate, ReportsBrokenLimits) {
  const robot::RobotModel nomad = testing::nomad();
  const auto broken = [](const json& motion) {
    std::map<std::string, std::array<double, 2>> by_name;
    const json told = answer(estimated, {{"profile", motion}});
    for (const json& limit : told["beyond_limits"])
      by_name[limit["limit"]] = {limit["reached"], limit["allowed"]};
    return by_name;
  };
  const double v = nomad.limits.speed_m_s, a = nomad.limits.acceleration_m_s2,
               yaw = nomad.limits.yaw_rate_rad_s;
  // A ramp of half the acceleration to half the speed keeps them all.
  EXPECT_TRUE(broken({{"time_s", {0, v / a, 2 * v / a}}, {"speed_m_s", {0, v / 2, 0}}}).empty());
  const auto fast = broken({{"time_s", {0, 2 * v / a, 4 * v / a}}, {"speed_m_s", {0, 1.5 * v, 0}}});
  ASSERT_TRUE(fast.contains("speed"));
  EXPECT_DOUBLE_EQ(fast.at("speed")[0], 1.5 * v);
  EXPECT_EQ(fast.at("speed")[1], v);
  EXPECT_FALSE(fast.contains("acceleration"));
  EXPECT_FALSE(fast.contains("yaw_rate"));
  // Turning in place the wheels' rims accelerate.
  const double rise_s = 2;
  const auto turn = broken(
      {{"time_s", {0, rise_s, 2 * rise_s}}, {"speed_m_s", {0, 0, 0}}, {"yaw_rate_rad_s", {0, -2 * yaw, 0}}});
  ASSERT_TRUE(turn.contains("yaw_rate"));
  EXPECT_DOUBLE_EQ(turn.at("yaw_rate")[0], 2 * yaw);
  const double rim = nomad.kinematics.half_track_m * 2 * yaw / rise_s;
  EXPECT_EQ(turn.contains("acceleration"), rim > a);
  const json path = {{{"kind", "straight"}, {"length_m", 3}}};
  EXPECT_TRUE(answer(estimated, {{"path", path}})["beyond_limits"].empty());
}

// The plan's columns, as answered, given back: within the limits, at the same price, over the same way.
TEST(Estimate, PlansAreWithinTheirLimits) {
  const auto straight = [](double m) { return json{{"kind", "straight"}, {"length_m", m}}; };
  const std::vector<json> paths = {
      {straight(5)},
      {straight(0.4)},
      {{{"kind", "turn"}, {"angle_rad", 1.3}}},
      {{{"kind", "arc"}, {"radius_m", 1.2}, {"angle_rad", 2}}},
      {straight(2), {{"kind", "arc"}, {"radius_m", 0.8}, {"angle_rad", -1.5}}, straight(1)},
      {straight(2), {{"kind", "turn"}, {"angle_rad", 1.3}}, straight(1)},
      {{{"kind", "clothoid"}, {"length_m", 4}, {"start_curvature_1_m", 0}, {"end_curvature_1_m", 0.7}}}};
  // The last current is just above the friction's, and bounds the braking too.
  for (const double current_a : {8.0, 0.8, 0.4, 0.235}) {
    robot::RobotModel robot = testing::nomad();
    robot.limits.current_a = current_a;
    if (current_a < 0.3) robot.limits.acceleration_m_s2 = 2;
    for (const double returned : {1.0, 0.0}) {
      robot.effects = {{"no_regeneration", {{"fraction", 1 - returned}}}};
      const auto weak = **model_in_force(robot, 1);
      for (const json& path : paths) {
        const auto text = profile_answer({{"path", path}, {"payload_kg", 5}}, weak);
        if (!text) {
          EXPECT_EQ(text.error().fault, Fault::infeasible) << describe(text.error());
          continue;
        }
        const json plan = json::parse(*text);
        const json& rows = plan["profile"];
        json given;
        for (const char* column : {"time_s", "speed_m_s", "yaw_rate_rad_s"}) given[column] = rows[column];
        const auto back = estimated({{"profile", given}, {"payload_kg", 5}}, weak);
        ASSERT_TRUE(back) << describe(back.error());
        const json told = json::parse(*back);
        EXPECT_TRUE(told["beyond_limits"].empty())
            << path.dump() << " " << current_a << told["beyond_limits"].dump();
        EXPECT_NEAR(told["energy_j"].get<double>(), plan["energy_j"].get<double>(),
                    1e-3 * plan["energy_j"].get<double>());
        EXPECT_NEAR(told["distance_m"].get<double>(), plan["distance_m"].get<double>(),
                    1e-4 * plan["distance_m"].get<double>() + 1e-9);
      }
    }
  }
}

TEST(Estimate, NamesColumnsOfOtherLengths) {
  json motion = {{"time_s", {0, 1}}, {"speed_m_s", {0, 1}}, {"yaw_rate_rad_s", {0, 0, 0}}};
  EXPECT_EQ(fault(estimated, {{"profile", motion}}).field, "/profile/yaw_rate_rad_s");
}

TEST(Estimate, PricesTheProfilesFloor) {
  robot::RobotModel climber = testing::nomad();
  climber.effects = {{"grade", {{"share", 1}}}};
  const ModelInForce with = **model_in_force(climber, 1);
  json motion = {{"time_s", {0, 2, 12, 14}}, {"speed_m_s", {0, 0.5, 0.5, 0}}};
  const auto priced = [&](const json& profile) {
    const auto text = estimated({{"profile", profile}, {"columns", true}}, with);
    EXPECT_TRUE(text) << describe(text.error());
    return text ? json::parse(*text) : json();
  };
  const double level = priced(motion)["energy_j"].get<double>();
  json uphill = motion, tilted = motion;
  uphill["height_m"] = {0, 0.02, 0.22, 0.24};
  tilted["climb_rad"] = {0.04, 0.04, 0.04, 0.04};
  const json a = priced(uphill), b = priced(tilted);
  const double weight = climber.total_mass_kg(0) * robot::standard_gravity_m_s2;
  EXPECT_NEAR(a["ledger"]["terms_j"]["potential"].get<double>(), weight * 0.24, 1e-4 * weight);
  EXPECT_NEAR(b["ledger"]["terms_j"]["potential"].get<double>(), weight * 6 * std::sin(0.04), 1e-4 * weight);
  for (const json& e : {a, b}) {
    const double energy = e["energy_j"].get<double>();
    EXPECT_GT(energy, level + weight * 0.23);
    EXPECT_NEAR(e["profile"]["energy_j"].back().get<double>(), energy, 1e-4 * energy);
  }
  uphill["climb_rad"] = tilted["climb_rad"];
  EXPECT_EQ(fault(estimated, {{"profile", uphill}}).field, "/profile/climb_rad");
  tilted["climb_rad"] = {0, 0};
  EXPECT_EQ(fault(estimated, {{"profile", tilted}}).field, "/profile/climb_rad");
}

TEST(Estimate, UsualDrivingEqualsTheForecast) {
  const json path = {{{"kind", "straight"}, {"length_m", 40}},
                     {{"kind", "turn"}, {"angle_rad", 1.5}},
                     {{"kind", "dwell"}, {"duration_s", 20}},
                     {{"kind", "straight"}, {"length_m", 20}}};
  const json usual = answer(estimated, {{"path", path}, {"payload_kg", 3}, {"driving", "usual"}});
  const json best = answer(estimated, {{"path", path}, {"payload_kg", 3}});
  EXPECT_EQ(best["driving"], "minimum_energy");
  EXPECT_TRUE(best["energy_quantiles_j"].is_null());
  EXPECT_EQ(usual["driving"], "usual");
  EXPECT_TRUE(usual["ledger"].is_null());
  EXPECT_GT(usual["energy_j"], best["energy_j"]);
  EXPECT_EQ(usual["distance_m"], best["distance_m"]);
  EXPECT_LT(usual["energy_quantiles_j"]["p05"], usual["energy_quantiles_j"]["p50"]);
  // By hand, of a robot without a past: 0.7 of its limits, trapezoids, its model; the mean lies above it.
  const robot::RobotModel nomad = testing::nomad();
  const double v = 0.7 * nomad.limits.speed_m_s, a = 0.7 * nomad.limits.acceleration_m_s2;
  const double w = 0.7 * nomad.limits.yaw_rate_rad_s, b = a / nomad.kinematics.half_track_m;
  EXPECT_NEAR(usual["duration_s"].get<double>(), 60 / v + 2 * v / a + 1.5 / w + w / b + 20, 0.5);
  EXPECT_EQ(fault(estimated, {{"path", path}, {"driving", "usual"}, {"deadline_s", 90}}).field,
            "/deadline_s");
  EXPECT_EQ(fault(estimated, {{"path", path}, {"driving", "usual"}, {"columns", true}}).field, "/columns");
}

// Curves that turn back are no straights, and on a slope the heading counts.
TEST(Profile, CurvesAndSlopesHaveOnePrice) {
  const json straight = {{"kind", "straight"}, {"length_m", 2.5}},
             dwell = {{"kind", "dwell"}, {"duration_s", 4}};
  const auto arc = [](double radius_m, double angle_rad) {
    return json{{"kind", "arc"}, {"radius_m", radius_m}, {"angle_rad", angle_rad}};
  };
  const json bend = {
      {"kind", "clothoid"}, {"length_m", 2}, {"start_curvature_1_m", -0.8}, {"end_curvature_1_m", 0.8}};
  robot::RobotModel tilted = testing::nomad();
  tilted.effects = {{"slope", {{"angle_rad", 0.03}, {"uphill_rad", 0.4}}}};
  for (const robot::RobotModel& robot : {testing::nomad(), tilted}) {
    const auto in_force = *model_in_force(robot, 1);
    for (const json& path : {json{straight}, json{straight, arc(0.5, 1.5), arc(0.5, -1.5), straight},
                             json{bend}, json{arc(1, 2), dwell, arc(0.6, -2), straight}}) {
      planning::CostTableCache tables;
      const auto profile = profile_answer({{"path", path}, {"columns", false}}, *in_force);
      const auto autonomy = autonomy_answer(
          {{"state_of_charge", 0.9}, {"driving", "minimum_energy"}, {"tasks", {{{"path", path}}}}},
          untried(in_force), {}, tables);
      ASSERT_TRUE(profile && autonomy) << path.dump();
      const json planned = json::parse(*profile), forecast = json::parse(*autonomy)["plan"];
      const double duration_s = planned["duration_s"], energy_j = planned["energy_j"];
      EXPECT_NEAR(forecast["duration_s"].get<double>(), duration_s, 1e-3 * duration_s) << path.dump();
      // A forecast is the mean of a skewed distribution, about half its relative variance above.
      EXPECT_NEAR(forecast["expected_energy_j"].get<double>(), energy_j, 0.02 * energy_j) << path.dump();
    }
  }
}

// A robot that its motors cannot move drives nowhere, neither as usual nor at its best.
TEST(Estimate, RejectsPathsBeyondTheMotors) {
  robot::RobotModel robot = testing::nomad();
  robot.motor.resistance_ohm = 500;
  const json path = {{{"kind", "straight"}, {"length_m", 10}}};
  for (const char* driving : {"usual", "minimum_energy"}) {
    const auto text = estimated({{"path", path}, {"driving", driving}}, **model_in_force(robot, 1));
    ASSERT_FALSE(text) << driving;
    EXPECT_EQ(text.error().fault, Fault::infeasible);
    EXPECT_EQ(text.error().field, "limits/voltage_v");
  }
}

// Whether the I/O thread may answer is decided before any path is made: a way of many knots is declined
// immediately.
TEST(Profile, OnlyShortPathsAreBrief) {
  const auto brief = [](std::initializer_list<json> path) {
    const auto input = read_profile({{"path", json(json::array_t(path))}}, model().robot);
    EXPECT_TRUE(input) << describe(input.error());
    return input && is_brief(input->drive.way.path);
  };
  const json straight = {{"kind", "straight"}, {"length_m", 5000}},
             dwell = {{"kind", "dwell"}, {"duration_s", 3}}, turn = {{"kind", "turn"}, {"angle_rad", 3}};
  const auto arc = [](double radius_m) {
    return json{{"kind", "arc"}, {"radius_m", radius_m}, {"angle_rad", -1}};
  };
  EXPECT_TRUE(brief({straight}));
  EXPECT_TRUE(brief({dwell, turn}));
  EXPECT_TRUE(brief({arc(2)}));
  EXPECT_FALSE(brief({straight, straight}));
  EXPECT_FALSE(brief({dwell}));
  EXPECT_FALSE(brief({arc(1e5)}));
  EXPECT_FALSE(
      brief({{{"kind", "clothoid"}, {"length_m", 1}, {"start_curvature_1_m", 0}, {"end_curvature_1_m", 1}}}));
}

// Brief or not, the answer is the same.
TEST(Profile, ImmediateAnswerIsTheSame) {
  robot::RobotModel slow = testing::nomad();  // at its cheapest below its limits
  slow.idle_power_w /= 10;
  slow.limits.speed_m_s *= 2;
  slow.limits.acceleration_m_s2 *= 2;
  const ModelInForce with = **model_in_force(slow, 1);
  int answered = 0;
  for (const double length_m : {0.5, 3.0, 40.0}) {
    const json request = {{"path", {{{"kind", "straight"}, {"length_m", length_m}}}}};
    const auto input = read_profile(request, with.robot);
    const auto at_once = profile_at_once(*input, with);
    if (!at_once) continue;
    ++answered;
    EXPECT_EQ(profile_json(*input, *at_once, with), *profile_answer(request, with));
  }
  EXPECT_GT(answered, 0);
}

TEST(Profile, StartPosesAreReadAlike) {
  const json path = {{{"kind", "straight"}, {"length_m", 3}}};
  const json motion = {{"time_s", {0, 2, 4}}, {"speed_m_s", {0, 1, 0}}};
  for (const json& pose : {json{{"x_m", 1}, {"y_m", 2}}, json{{"x_m", 1}, {"y_m", 2}, {"heading_rad", 1e5}},
                           json{{"x_m", 1}, {"y_m", "left"}, {"heading_rad", 0}}}) {
    const Error planned = fault(profile_answer, {{"path", path}, {"start_pose", pose}});
    EXPECT_EQ(planned, fault(estimated, {{"path", path}, {"start_pose", pose}}));
    EXPECT_EQ(planned, fault(estimated, {{"profile", motion}, {"start_pose", pose}}));
    EXPECT_TRUE(planned.field.starts_with("/start_pose/")) << planned.field;
  }
}

TEST(Profile, SpendsAnEnergyBudget) {
  const json path = {{{"kind", "turn"}, {"angle_rad", 3}}, {{"kind", "straight"}, {"length_m", 1}}};
  const auto energy_j = [&](double value_of_time_w) -> double {
    return answer(profile_answer, {{"path", path}, {"value_of_time_w", value_of_time_w}})["energy_j"];
  };
  const double least_j = energy_j(0), budget_j = 0.5 * (least_j + energy_j(1e6));
  const json a = answer(profile_answer, {{"path", path}, {"energy_budget_j", budget_j}});
  EXPECT_LE(a["energy_j"], budget_j);
  EXPECT_GT(a["energy_j"], budget_j - 0.3 * (budget_j - least_j));
  EXPECT_EQ(a["certificate"]["binding"].back(), "energy_budget");
  EXPECT_TRUE(a["needed_speed_m_s"].is_null());
  // The same duration as a deadline takes the same energy.
  const json again = answer(profile_answer, {{"path", path}, {"deadline_s", a["duration_s"]}});
  EXPECT_NEAR(again["energy_j"], a["energy_j"].get<double>(), 1e-4 * least_j);
  EXPECT_EQ(fault(profile_answer, {{"distances_m", {1e-300}}}).field, "/distances_m");
  EXPECT_EQ(fault(profile_answer, {{"path", {{{"kind", "turn"}, {"angle_rad", 1e-300}}}}}).field, "path");
  const json start = {{"x_m", 0}, {"y_m", 0}};
  EXPECT_EQ(fault(profile_answer, {{"pickup", start}, {"dropoff", start}}).field, "pickup");
  EXPECT_EQ(fault(profile_answer, {{"path", path}, {"energy_budget_j", 9}, {"deadline_s", 9}}).field,
            "/energy_budget_j");
  EXPECT_EQ(fault(profile_answer, {{"path", path}, {"energy_budget_j", 0.5 * least_j}}).fault,
            Fault::infeasible);
}

TEST(Profile, TellsTheSpeedThatADeadlineNeeds) {
  const json path = {{{"kind", "straight"}, {"length_m", 10}}};
  EXPECT_TRUE(answer(profile_answer, {{"path", path}})["needed_speed_m_s"].is_null());
  // In free time the Nomad drives 10 m nearly as fast as it can: little to trade, but a front.
  const json front = answer(profile_answer, {{"path", path}, {"pareto_points", 4}})["pareto"];
  ASSERT_EQ(front.size(), 4u);
  EXPECT_LT(front[3]["duration_s"], front[0]["duration_s"]);
  // With a price on top there is no front.
  EXPECT_EQ(answer(profile_answer, {{"path", path}, {"pareto_points", 4}, {"value_of_time_w", 1e6}})["pareto"]
                .size(),
            1u);
  const json a = answer(
      profile_answer,
      {{"path", path}, {"deadline_s", 20}, {"pareto_points", 4}, {"limits", {{"acceleration_m_s2", 0.3}}}});
  const double needed = a["needed_speed_m_s"].get<double>();
  EXPECT_GT(needed, 10.0 / 20);
  EXPECT_LE(needed, a["peak_speed_m_s"].get<double>() * (1 + 1e-9));
  EXPECT_GT(a["pareto"][0]["peak_speed_m_s"].get<double>(), needed);
}

}  // namespace
}  // namespace joulecast::answers
