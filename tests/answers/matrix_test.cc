#include "answers/matrix.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "answers/autonomy.h"
#include "planning/cost_matrix.h"
#include "tests/support/sample_robots.h"

namespace joulecast::answers {
namespace {

using nlohmann::json;

class MatrixAnswer : public ::testing::Test {
 protected:
  MatrixAnswer() {
    add("a", 10.5);
    add("b", 4);
    fleet_.model = [this](const std::string& id) -> Result<std::shared_ptr<const ModelInForce>> {
      if (const auto found = models_.find(id); found != models_.end()) return found->second;
      return fail(Fault::not_found, "id", "no robot " + id);
    };
    fleet_.live = [](const std::string& id) {
      LiveRobot now;
      if (id == "a") now.pose = planning::Pose{0, 0, 0};
      return now;
    };
    fleet_.outlook = untried;
  }

  void add(const std::string& id, double payload_limit_kg) {
    robot::RobotModel robot = testing::nomad();
    robot.robot_id = id;
    robot.limits.payload_kg = payload_limit_kg;
    models_[id] = *model_in_force(robot, static_cast<std::int64_t>(models_.size() + 1));
  }

  static json with_payload(json task, double payload_kg) {
    task["payload_kg"] = payload_kg;
    return task;
  }

  Error error_of(const json& request) {
    const auto input = read_matrix(request);
    EXPECT_FALSE(input) << request;
    return input ? Error{} : input.error();
  }

  MatrixText text_of(const json& request) {
    auto input = read_matrix(request);
    EXPECT_TRUE(input) << describe(input.error());
    return MatrixText(::joulecast::answers::Matrix(std::move(*input), fleet_, tables_));
  }

  json answer_to(const json& request, int* pieces = nullptr) {
    MatrixText answer = text_of(request);
    std::string text;
    int count = 1;
    while (answer.next(text, {})) ++count;
    if (pieces != nullptr) *pieces = count;
    return json::parse(text);
  }

  std::map<std::string, std::shared_ptr<const ModelInForce>> models_;
  MatrixFleet fleet_;
  planning::CostTableCache tables_;
  const json stations_ = {{"task_id", "t1"},
                          {"payload_kg", 5},
                          {"pickup", {{"x_m", 3}, {"y_m", 0}}},
                          {"dropoff", {{"x_m", 3}, {"y_m", 4}, {"heading_rad", 0}}}};
  const json legs_ = {{"task_id", "t2"},
                      {"empty", {{"distances_m", {4}}}},
                      {"loaded", {{"distances_m", {1, 2}}, {"turns_rad", {1.5}}}},
                      {"pickup_dwell_s", 10}};
};

TEST_F(MatrixAnswer, ReturnsTaskChances) {
  json far = stations_;
  far["task_id"] = "far";
  far["dropoff"] = {{"x_m", 3}, {"y_m", 9000}};
  const json request = {{"robots",
                         {{{"robot_id", "a"}, {"state_of_charge", 0.8}},
                          {{"robot_id", "a"}, {"state_of_charge", 0.16}},
                          {{"robot_id", "b"}, {"state_of_charge", 0.8}, {"pose", {{"x_m", 0}, {"y_m", 0}}}},
                          "a"}},
                        {"tasks", {stations_, far}}};
  const json rows = answer_to(request)["rows"];
  EXPECT_GT(rows[0]["success_probability"][0], 0.99);
  EXPECT_LT(rows[1]["success_probability"][1], 0.01);
  EXPECT_GT(rows[1]["success_probability"][0], rows[1]["success_probability"][1]);
  EXPECT_TRUE(rows[2]["success_probability"][0].is_null());  // too heavy for it
  EXPECT_TRUE(rows[3]["success_probability"].is_null());     // charge unknown
}

// The charge that is needed, given in another request, suffices; a little less does not.
TEST_F(MatrixAnswer, NeededChargeSuffices) {
  json far = stations_;
  far["dropoff"] = {{"x_m", 3}, {"y_m", 3000}};
  for (const char* driving : {"minimum_energy", "usual"}) {
    const auto row_at = [&](const json& robot) {
      return answer_to({{"robots", json::array({robot})},
                        {"tasks", {stations_, far, with_payload(far, 50)}},
                        {"driving", driving}})["rows"][0];
    };
    const json low = row_at({{"robot_id", "a"}, {"state_of_charge", 0.17}});
    EXPECT_TRUE(low["charge_needed"][0].is_null());  // it suffices
    EXPECT_EQ(low["available_in_s"][0], 0);
    EXPECT_TRUE(low["available_in_s"][1].is_null());  // a given charge is not at a charger
    EXPECT_TRUE(low["charge_needed"][2].is_null());   // infeasible
    EXPECT_TRUE(low["available_in_s"][2].is_null());
    ASSERT_TRUE(low["charge_needed"][1].is_number()) << low;
    const double needed = low["charge_needed"][1];
    EXPECT_GT(needed, 0.17);
    const json enough = row_at({{"robot_id", "a"}, {"state_of_charge", needed}});
    EXPECT_GE(enough["success_probability"][1], 0.95);
    EXPECT_EQ(enough["available_in_s"][1], 0);
    EXPECT_LT(row_at({{"robot_id", "a"}, {"state_of_charge", needed - 0.01}})["success_probability"][1],
              0.95);
    EXPECT_TRUE(row_at("a")["charge_needed"].is_null());  // charge unknown

    // At its charger, a half of the remaining charge arrives in half of the time.
    fleet_.live = [&](const std::string&) {
      LiveRobot now;
      now.pose = planning::Pose{0, 0, 0};
      now.state_of_charge = 0.17;
      now.charging = battery::ChargingPhase::constant_current;
      now.to_full.duration_s = 1000;
      return now;
    };
    const json charging = row_at("a");
    EXPECT_EQ(charging["available_in_s"][0], 0);
    EXPECT_NEAR(charging["available_in_s"][1].get<double>(), 1000 * (needed - 0.17) / 0.83, 1e-3);
    fleet_.live = [](const std::string& id) {
      LiveRobot now;
      if (id == "a") now.pose = planning::Pose{0, 0, 0};
      return now;
    };
  }
}

TEST_F(MatrixAnswer, AnswersOneRowPerRobot) {
  json request = {{"robots", json::array({"a"})}, {"tasks", {stations_, legs_}}};
  for (int k = 0; k < 40; ++k)
    request["robots"].push_back({{"robot_id", k % 2 ? "a" : "b"}, {"pose", {{"x_m", k}, {"y_m", 0}}}});
  int pieces = 0;
  const json all = answer_to(request, &pieces);
  EXPECT_GT(pieces, 3);
  EXPECT_EQ(all["task_ids"], json({"t1", "t2"}));
  ASSERT_EQ(all["rows"].size(), 41u);
  EXPECT_EQ(tables_.size(), 2u);
  for (std::size_t r = 0; r < 41; ++r) {
    const json& row = all["rows"][r];
    const bool strong = row["robot_id"] == "a";
    EXPECT_EQ(row["robot_id"], r == 0 || r % 2 == 0 ? "a" : "b");
    EXPECT_EQ(row["model_version"], strong ? 1 : 2);
    EXPECT_LT(row["interpolation_error"].get<double>(), 2e-3);
    EXPECT_EQ(row["energy_j"][0].is_null(), !strong);
    EXPECT_EQ(row["duration_s"][0].is_null(), !strong);
    EXPECT_TRUE(row["energy_j"][1].is_number());
    if (strong) {
      EXPECT_TRUE(row["infeasible"].empty());
    } else {
      EXPECT_EQ(row["infeasible"][0]["reason"], "payload");
      EXPECT_EQ(row["infeasible"][0]["task_ids"], json({"t1"}));
      EXPECT_NE(row["infeasible"][0]["detail"].get<std::string>().find("4 kg"), std::string::npos);
    }
    // Given legs do not depend on the robot's position.
    EXPECT_EQ(row["energy_j"][1], all["rows"][strong ? 0 : 1]["energy_j"][1]);
  }
  // Farther away costs more.
  EXPECT_GT(all["rows"][40]["energy_j"][0].get<double>(), all["rows"][0]["energy_j"][0].get<double>());
}

// The same legs as a task list of the same robot, driven as it usually drives.
TEST_F(MatrixAnswer, UsualDrivingEqualsAutonomy) {
  json far = stations_;
  far["payload_kg"] = 50;
  json request = {{"robots", {{{"robot_id", "a"}, {"state_of_charge", 0.8}}, "b"}},
                  {"tasks", {stations_, legs_, far}},
                  {"driving", "usual"}};
  const json all = answer_to(request);
  EXPECT_EQ(all["driving"], "usual");
  EXPECT_EQ(tables_.size(), 0u);  // none is built for it
  const json& row = all["rows"][0];
  EXPECT_TRUE(row["interpolation_error"].is_null());
  EXPECT_TRUE(row["energy_j"][2].is_null());
  EXPECT_EQ(row["infeasible"][0]["reason"], "payload");
  EXPECT_GT(row["success_probability"][0], 0.99);
  EXPECT_TRUE(all["rows"][1]["energy_j"][0].is_null());
  EXPECT_EQ(all["rows"][1]["infeasible"][0]["reason"], "payload");
  // To the pick-up empty, a turn there, four metres loaded, a turn at the drop-off.
  const double quarter = std::acos(0.0);
  const json tasks = {
      {{"task_id", "go"}, {"distances_m", {3}}, {"payload_kg", 0}},
      {{"task_id", "bring"}, {"turns_rad", {quarter}}, {"distances_m", {0, 4}}, {"payload_kg", 5}},
      {{"task_id", "set"}, {"turns_rad", {-quarter}}}};
  const auto text = autonomy_answer({{"state_of_charge", 0.8}, {"payload_kg", 0}, {"tasks", tasks}},
                                    untried(models_.at("a")), {}, tables_);
  ASSERT_TRUE(text) << describe(text.error());
  const json plan = json::parse(*text)["plan"];
  EXPECT_NEAR(row["energy_j"][0].get<double>(), plan["expected_energy_j"].get<double>(), 1e-3);
  EXPECT_NEAR(row["duration_s"][0].get<double>(), plan["duration_s"].get<double>(), 1e-3);
  EXPECT_NEAR(row["success_probability"][0].get<double>(), plan["success_probability"].get<double>(), 1e-4);
  request["driving"] = "minimum_energy";
  EXPECT_LT(answer_to(request)["rows"][0]["energy_j"][0], row["energy_j"][0]);
  request["driving"] = "usual";
  request["value_of_time_w"] = 3;
  EXPECT_EQ(error_of(request).field, "/value_of_time_w");
}

// The thesis's power (2-31), (2-32) over a trapezoid of 0.7 of the limits, the usual driving of a robot
// without missions, whose centre of mass is on its axle.
double usual_energy_j(const robot::RobotModel& r, double way, bool turns, double payload_kg,
                      double& duration_s) {
  const double radius = r.kinematics.wheel_radius_m, l = r.kinematics.half_track_m;
  const double a = 0.7 * r.limits.acceleration_m_s2 / (turns ? l : 1);
  const double top = 0.7 * (turns ? r.limits.yaw_rate_rad_s : r.limits.speed_m_s);
  const double v = std::min(top, std::sqrt(way * a)), ramp = v / a, cruise = way / v - ramp;
  duration_s += 2 * ramp + cruise;
  const double mass = r.mass.chassis_kg + 2 * r.mass.wheel_kg + payload_kg;
  const double yaw_inertia = r.mass.yaw_inertia_kg_m2 + 0.02 * payload_kg;
  const double constant = r.motor.torque_constant_nm_a * r.motor.gear_ratio;
  const double wheel = turns ? l / radius : 1 / radius;  // of the body's speed
  const double inertia = (turns ? 0.5 * radius * yaw_inertia / l : 0.5 * radius * mass) +
                         (r.mass.wheel_inertia_kg_m2 + r.motor.rotor_inertia_kg_m2) * wheel;
  double energy = r.idle_power_w * (2 * ramp + cruise);
  for (const double dry : r.motor.friction_torque_nm) {
    const auto power = [&](double speed, double acceleration) {
      const double w = wheel * speed;
      const double torque = inertia * acceleration + r.motor.viscous_friction_nm_s_rad * w + dry;
      return r.motor.resistance_ohm * torque * torque / (constant * constant) + w * torque;
    };
    // Simpson's rule is exact: power is a square of the speed.
    for (const double slope : {a, -a})
      energy += ramp / 6 * (power(0, slope) + 4 * power(0.5 * v, slope) + power(v, slope));
    energy += cruise * power(v, 0);
  }
  return energy;
}

// A thousand robots by a thousand tasks of usual driving: no cell is missing, a hundred are compared, and the
// answer's pieces are far from the time that one request may take.
TEST_F(MatrixAnswer, UsualDrivingPricesAMillion) {
  constexpr int size = 1000;
  std::mt19937_64 random(36);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  std::vector<std::array<double, 2>> starts(size), picks(size), drops(size);
  std::vector<double> loads(size), headings(size);
  json request = {{"robots", json::array()}, {"tasks", json::array()}, {"driving", "usual"}};
  for (std::size_t k = 0; k < size; ++k) {
    starts[k] = {between(0, 120), between(0, 80)}, headings[k] = between(-3, 3);
    picks[k] = {between(0, 120), between(0, 80)}, drops[k] = {between(0, 120), between(0, 80)};
    loads[k] = between(0, 10);
    request["robots"].push_back(
        {{"robot_id", "a"},
         {"pose", {{"x_m", starts[k][0]}, {"y_m", starts[k][1]}, {"heading_rad", headings[k]}}}});
    request["tasks"].push_back({{"task_id", std::to_string(k)},
                                {"payload_kg", loads[k]},
                                {"pickup", {{"x_m", picks[k][0]}, {"y_m", picks[k][1]}}},
                                {"dropoff", {{"x_m", drops[k][0]}, {"y_m", drops[k][1]}}}});
  }
  // A robot of exactly its model, so that means are those of the model.
  fleet_.outlook = [](std::shared_ptr<const ModelInForce> model) {
    RobotOutlook outlook = untried(std::move(model));
    forecast::Forecaster exact = *outlook.forecaster;
    for (auto& track : exact.tracks) track.correction.covariance = {}, track.common = 0, track.scatter = {};
    outlook.forecaster = std::make_shared<forecast::Forecaster>(std::move(exact));
    return outlook;
  };
  MatrixText answer = text_of(request);
  std::string text;
  std::clock_t longest = 0, last = std::clock();
  const std::clock_t begun = last;
  while (answer.next(text, {})) longest = std::max(longest, std::clock() - last), last = std::clock();
  const double usual_s = static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC;
  EXPECT_LT(static_cast<double>(longest) / CLOCKS_PER_SEC, 0.1 * usual_s);
  const json rows = json::parse(text)["rows"];
  ASSERT_EQ(rows.size(), static_cast<std::size_t>(size));
  std::size_t priced = 0;
  for (const json& row : rows)
    for (const json& energy : row["energy_j"]) priced += energy.is_number() && energy > 0;
  EXPECT_EQ(priced, static_cast<std::size_t>(size) * size);

  const robot::RobotModel& robot = models_.at("a")->robot;
  const auto turned = [](double from, double to) {
    return std::fabs(std::remainder(to - from, 2 * std::numbers::pi));
  };
  for (std::size_t k = 0; k < 100; ++k) {
    const std::size_t r = random() % size, t = random() % size;
    const auto leg = [](const auto& from, const auto& to) {
      return std::pair{std::hypot(to[0] - from[0], to[1] - from[1]),
                       std::atan2(to[1] - from[1], to[0] - from[0])};
    };
    const auto [empty_m, there] = leg(starts[r], picks[t]);
    const auto [loaded_m, back] = leg(picks[t], drops[t]);
    double duration = 0;
    const double energy = usual_energy_j(robot, turned(headings[r], there), true, 0, duration) +
                          usual_energy_j(robot, empty_m, false, 0, duration) +
                          usual_energy_j(robot, turned(there, back), true, loads[t], duration) +
                          usual_energy_j(robot, loaded_m, false, loads[t], duration);
    // The model fades dry friction below 0.005 rad/s.
    EXPECT_NEAR(rows[r]["energy_j"][t].get<double>(), energy, 1e-4 * energy) << r << " " << t;
    EXPECT_NEAR(rows[r]["duration_s"][t].get<double>(), duration, 1e-3) << r << " " << t;
  }
}

TEST_F(MatrixAnswer, StopsAfterTheClientLeft) {
  json request = {{"robots", json::array()}, {"tasks", {stations_}}};
  for (int k = 0; k < 100; ++k) request["robots"].push_back("a");
  MatrixText answer = text_of(request);
  std::stop_source client;
  std::string text;
  ASSERT_TRUE(answer.next(text, client.get_token()));
  ASSERT_TRUE(answer.next(text, client.get_token()));
  const std::string so_far = text;
  client.request_stop();
  EXPECT_FALSE(answer.next(text, client.get_token()));
  EXPECT_EQ(text, so_far);
}

TEST_F(MatrixAnswer, ErrorsAffectOneRobotOnly) {
  // b reports no pose: tasks with a given way to their pick-up are answered all the same.
  const json request = {{"robots", {"absent", "b", "a"}}, {"tasks", {with_payload(stations_, 1), legs_}}};
  const json rows = answer_to(request)["rows"];
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_TRUE(rows[0]["model_version"].is_null());
  EXPECT_EQ(rows[0]["energy_j"], json({nullptr, nullptr}));
  EXPECT_EQ(rows[0]["infeasible"],
            json::array({{{"reason", "model"}, {"detail", "no robot absent"}, {"task_ids", {"t1", "t2"}}}}));
  EXPECT_TRUE(rows[1]["energy_j"][0].is_null());
  EXPECT_GT(rows[1]["energy_j"][1], 0);
  ASSERT_EQ(rows[1]["infeasible"].size(), 1u);
  EXPECT_EQ(rows[1]["infeasible"][0]["reason"], "pose");
  EXPECT_EQ(rows[1]["infeasible"][0]["task_ids"], json({"t1"}));
  EXPECT_GT(rows[2]["energy_j"][0], 0);
  EXPECT_EQ(rows[2]["energy_j"][1], rows[1]["energy_j"][1]);
  EXPECT_TRUE(rows[2]["infeasible"].empty());
}

TEST_F(MatrixAnswer, OmitsTasksBeyondTheMotors) {
  robot::RobotModel robot = testing::nomad();
  robot.robot_id = "a";
  robot.motor.resistance_ohm = 500;
  models_["a"] = *model_in_force(robot, 9);
  for (const char* driving : {"usual", "minimum_energy"}) {
    const json row = answer_to({{"robots", {"a"}}, {"tasks", {legs_}}, {"driving", driving}})["rows"][0];
    EXPECT_TRUE(row["energy_j"][0].is_null()) << driving;
    ASSERT_EQ(row["infeasible"].size(), 1u) << driving;
    EXPECT_EQ(row["infeasible"][0]["reason"], "limits");
    EXPECT_NE(row["infeasible"][0]["detail"].get<std::string>().find("limits/voltage_v: is "),
              std::string::npos);
  }
}

TEST_F(MatrixAnswer, NamesTheFieldAtFault) {
  const json a = {"a"};
  const auto with = [](json object, const char* name, json value) {
    object[name] = std::move(value);
    return object;
  };
  struct Case {
    json request;
    const char* field;
    Fault fault = Fault::invalid;
  };
  json far = stations_;
  far["dropoff"]["x_m"] = 50'000;
  json leg = legs_;
  leg["loaded"]["turns_rad"] = {1, "left"};
  const json loaded = {{"path", {{{"kind", "payload"}, {"payload_kg", 5}}}}};
  json rows = json::array();
  for (int k = 0; k < 2000; ++k) rows.push_back("a");
  json columns = json::array();
  for (int k = 0; k < 2001; ++k) columns.push_back(legs_);
  json usual_columns = json::array();
  for (int k = 0; k < 501; ++k) usual_columns.push_back(legs_);
  for (const Case& c : std::vector<Case>{
           {json::array(), ""},
           {{{"tasks", {legs_}}}, "/robots"},
           {{{"robots", a}}, "/tasks"},
           {{{"robots", json::array()}, {"tasks", {legs_}}}, "/robots"},
           {{{"robots", {"a", {{"robot_id", "b"}, {"pose", {{"x_m", 0}}}}}}, {"tasks", {legs_}}},
            "/robots/1/pose/y_m"},
           {{{"robots", a}, {"tasks", {legs_, with(legs_, "payload_kg", -1)}}}, "/tasks/1/payload_kg"},
           {{{"robots", a}, {"tasks", {with(legs_, "colour", 1)}}}, "/tasks/0/colour"},
           {{{"robots", a},
             {"tasks",
              {with(legs_, "empty", json::array({{{"distances_m", {1}}}, {{"distances_m", {2}}}}))}}},
            "/tasks/0/empty"},
           {{{"robots", a}, {"tasks", {with(stations_, "pickup", nullptr)}}}, "/tasks/0/pickup"},
           {{{"robots", a}, {"tasks", {with(stations_, "dropoff", nullptr)}}}, "/tasks/0/dropoff"},
           {{{"robots", a}, {"tasks", {far}}}, "/tasks/0/dropoff"},
           {{{"robots", a}, {"tasks", {leg}}}, "/tasks/0/loaded/turns_rad/1"},
           {{{"robots", a}, {"tasks", {with(legs_, "loaded", loaded)}}}, "/tasks/0/loaded/path/0/payload_kg"},
           {{{"robots", a}, {"tasks", {legs_}}, {"regeneration", 1.5}}, "/regeneration"},
           {{{"robots", rows}, {"tasks", columns}}, "/tasks", Fault::too_large},
           {{{"robots", rows}, {"tasks", usual_columns}, {"driving", "usual"}},
            "/tasks",
            Fault::too_large}}) {
    const Error error = error_of(c.request);
    EXPECT_EQ(error.field, c.field) << describe(error);
    EXPECT_EQ(error.fault, c.fault) << describe(error);
  }
}

}  // namespace
}  // namespace joulecast::answers
