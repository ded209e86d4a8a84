// One task has one price in all calls.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "answers/autonomy.h"
#include "answers/estimate.h"
#include "answers/matrix.h"
#include "answers/profile.h"
#include "tests/support/sample_robots.h"

namespace joulecast::answers {
namespace {

using nlohmann::json;

struct Price {
  double energy_j, duration_s;
};

// Four robots in ten pause for some seconds after a leg.
RobotOutlook halting(const robot::RobotModel& robot) {
  RobotOutlook outlook = untried(*model_in_force(robot, 1));
  auto forecaster = std::make_shared<forecast::Forecaster>(*outlook.forecaster);
  for (forecast::Halts& halts : forecaster->habit.halts) halts = {200, 0.43, 1.6, 6};
  outlook.forecaster = std::move(forecaster);
  return outlook;
}

// A way in one of its forms, with what is carried.
struct Task {
  json way;
  double payload_kg = 0, dwell_s = 0;
};

class OnePrice : public ::testing::TestWithParam<int> {
 protected:
  double between(double a, double b) { return std::uniform_real_distribution(a, b)(random_); }

  json random_place() {
    json place = {{"x_m", between(-20, 20)}, {"y_m", between(-20, 20)}};
    if (between(0, 1) < 0.5) place["heading_rad"] = between(-3, 3);
    return place;
  }

  // Curves, turns and straights.
  json random_path() {
    json path = json::array();
    for (int k = 0; k < 1 + GetParam() % 4; ++k) {
      if ((k + GetParam()) % 3 == 2)
        path.push_back({{"kind", "turn"}, {"angle_rad", between(-3, 3)}});
      else if (GetParam() % 5 == 3)
        path.push_back({{"kind", "arc"}, {"radius_m", between(1, 5)}, {"angle_rad", between(0.5, 3)}});
      else
        path.push_back({{"kind", "straight"}, {"length_m", between(0.5, 20)}});
      path.push_back({{"kind", "dwell"}, {"duration_s", GetParam() % 2 ? between(0, 9) : 0}});
    }
    return path;
  }

  Task random_task() {
    Task task;
    task.payload_kg = between(0, 10);
    switch (GetParam() % 3) {
      case 0:
        task.way = {{"path", random_path()}};
        break;
      case 1:
        task.way = {{"distances_m", {between(1, 20), between(1, 20)}}, {"turns_rad", {between(-3, 3)}}};
        break;
      default:
        task.way = {{"pickup", random_place()}, {"dropoff", random_place()}};
    }
    if (GetParam() % 2) task.dwell_s = between(1, 10);
    return task;
  }

  json parsed(const Result<std::string>& text) {
    EXPECT_TRUE(text) << (text ? "" : describe(text.error()));
    return text ? json::parse(*text) : json::object();
  }

  // The request of a way with a dwell at its end, with what each call needs besides.
  static json of_way(const Task& task, const json& more) {
    json request = task.way;
    request["payload_kg"] = task.payload_kg;
    if (task.way.contains("path") && task.dwell_s > 0)
      request["path"].push_back({{"kind", "dwell"}, {"duration_s", task.dwell_s}});
    if (task.way.contains("pickup") && task.dwell_s > 0)
      request["pickup_dwell_s"] = 8, request["dropoff_dwell_s"] = task.dwell_s;
    request.update(more);
    return request;
  }

  Price by_estimate(const Task& task, const char* driving) {
    const json a = parsed(estimate_answer(of_way(task, {{"driving", driving}}), robot_));
    return {a["energy_j"], a["duration_s"]};
  }
  Price by_profile(const Task& task) {
    const json a = parsed(profile_answer(of_way(task, {{"columns", false}}), *robot_.model));
    return {a["energy_j"], a["duration_s"]};
  }
  Price by_matrix(const Task& task, const char* driving) {
    json given = of_way(task, {{"task_id", "t"}});
    if (!task.way.contains("pickup")) {
      json loaded = json::object();
      for (const char* member : {"path", "distances_m", "turns_rad"})
        if (given.contains(member)) loaded[member] = given[member], given.erase(member);
      given.update({{"empty", json::object()}, {"loaded", loaded}});
    }
    MatrixFleet fleet;
    fleet.model = [&](const std::string&) -> Result<std::shared_ptr<const ModelInForce>> {
      return robot_.model;
    };
    fleet.live = [](const std::string&) { return LiveRobot{}; };
    fleet.outlook = [&](const auto&) { return robot_; };
    auto input = read_matrix({{"robots", {{{"robot_id", "nomad"}, {"pose", {{"x_m", 0}, {"y_m", 0}}}}}},
                              {"driving", driving},
                              {"tasks", {given}}});
    EXPECT_TRUE(input) << (input ? "" : describe(input.error()));
    if (!input) return {};
    Matrix matrix(std::move(*input), fleet, tables_);
    while (matrix.prepare(std::chrono::milliseconds(1000))) {
    }
    const MatrixRow row = matrix.row(0);
    return {row.energy_j.at(0), row.duration_s.at(0)};
  }
  // Usual driving of a distance with a dwell that is stated, 0 included, or null.
  Price usual_by_matrix(double distance_m, const json& dwell_s) {
    MatrixFleet fleet;
    fleet.model = [&](const std::string&) -> Result<std::shared_ptr<const ModelInForce>> {
      return robot_.model;
    };
    fleet.live = [](const std::string&) { return LiveRobot{}; };
    fleet.outlook = [&](const auto&) { return robot_; };
    Matrix matrix(*read_matrix({{"robots", {{{"robot_id", "nomad"}}}},
                                {"driving", "usual"},
                                {"tasks",
                                 {{{"task_id", "t"},
                                   {"empty", json::object()},
                                   {"loaded", {{"distances_m", {distance_m}}}},
                                   {"dropoff_dwell_s", dwell_s}}}}}),
                  fleet, tables_);
    while (matrix.prepare(std::chrono::milliseconds(1000))) {
    }
    const MatrixRow row = matrix.row(0);
    return {row.energy_j.at(0), row.duration_s.at(0)};
  }
  Price usual_by_autonomy(double distance_m, const json& dwell_s) {
    const json a = parsed(autonomy_answer(
        {{"state_of_charge", 0.9}, {"tasks", {{{"distances_m", {distance_m}}, {"dwell_s", dwell_s}}}}},
        robot_, {}, tables_));
    return {a["plan"]["expected_energy_j"], a["plan"]["duration_s"]};
  }
  Price by_autonomy(const Task& task, const char* driving) {
    const json a = parsed(autonomy_answer(
        {{"state_of_charge", 0.9}, {"driving", driving}, {"tasks", {of_way(task, {{"task_id", "t"}})}}},
        robot_, {}, tables_));
    return {a["plan"]["expected_energy_j"], a["plan"]["duration_s"]};
  }

  static void expect_same(const Price& a, const Price& b, double energy_share, double duration_share) {
    EXPECT_NEAR(a.energy_j, b.energy_j, energy_share * b.energy_j);
    EXPECT_NEAR(a.duration_s, b.duration_s, duration_share * b.duration_s);
  }

  std::mt19937_64 random_{static_cast<std::uint64_t>(GetParam())};
  RobotOutlook robot_ = halting(testing::nomad());
  planning::CostTableCache tables_;
};

TEST_P(OnePrice, OfDwellsAndTheirAbsence) {
  const double distance_m = between(1, 30);
  for (const json& dwell_s : {json(), json(0), json(20)})
    expect_same(usual_by_matrix(distance_m, dwell_s), usual_by_autonomy(distance_m, dwell_s), 1e-6, 1e-6);
  EXPECT_GT(usual_by_matrix(distance_m, json()).duration_s, usual_by_matrix(distance_m, 0).duration_s);
}

TEST_P(OnePrice, OfThePlannersDriving) {
  const Task task = random_task();
  SCOPED_TRACE(of_way(task, json::object()).dump());
  const Price profile = by_profile(task);
  expect_same(by_estimate(task, "minimum_energy"), profile, 1e-9, 1e-9);
  expect_same(by_matrix(task, "minimum_energy"), profile, 1e-3, 5e-3);
  // A forecast is the mean of a skewed distribution, about half its relative variance above.
  expect_same(by_autonomy(task, "minimum_energy"), profile, 0.02, 5e-3);
}

TEST_P(OnePrice, OfUsualDriving) {
  const Task task = random_task();
  SCOPED_TRACE(of_way(task, json::object()).dump());
  const Price estimate = by_estimate(task, "usual");
  expect_same(by_matrix(task, "usual"), estimate, 1e-6, 1e-4);
  expect_same(by_autonomy(task, "usual"), estimate, 1e-6, 1e-4);
}

// The three forms with and without a dwell, curves among the paths.
INSTANTIATE_TEST_SUITE_P(OfThirtyTasks, OnePrice, ::testing::Range(0, 30));

}  // namespace
}  // namespace joulecast::answers
