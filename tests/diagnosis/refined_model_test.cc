#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "client/virtual_robot/fleet.h"
#include "robot/robot_fields.h"
#include "robot/robot_file.h"
#include "server/diagnosis/proposal_review.h"
#include "signals/sample.h"
#include "tests/ingest/harness.h"

namespace joulecast::server {
namespace {

using nlohmann::json;

// 16 missions of a robot with more friction than its file.
virtual_robot::SimulationSpec rubbing(std::string_view robot_json) {
  virtual_robot::SimulationSpec spec;
  spec.robot = virtual_robot::parse_robot(std::string(robot_json)).value();
  spec.missions = 16;
  spec.imperfections.coulomb_friction = 0.3;
  return spec;
}

// Handles all messages of the robot; `ended` follows each mission, with its number from 1.
void drive(testing::PipelineHarness& harness, const std::string& robot_id,
           virtual_robot::VirtualRobot& machine, const std::function<void(int)>& ended) {
  int missions = 0;
  while (auto emission = machine.next()) {
    std::visit(
        [&](auto& message) {
          harness.pipeline->handle({robot_id, message, emission->utime_us});
        },
        emission->message);
    if (const auto* event = std::get_if<signals::MissionEvent>(&emission->message))
      if (event->phase != signals::MissionPhase::started) ended(++missions);
  }
}

// The session proposes a model from ordinary missions. After its back-test the model is adopted.
TEST(RefinedModel, IsProposedAndAdopted) {
  const auto shipped = virtual_robot::shipped_robots()[0];
  const robot::RobotModel robot = robot::parse_robot(shipped.json_text).value();
  testing::PipelineHarness harness;
  harness.add_version(robot, 1);
  virtual_robot::SimulationSpec spec = rubbing(shipped.json_text);
  spec.script.undeclared_share = 0.2;
  spec.imperfections.accessory_load = 3;
  virtual_robot::VirtualRobot machine(spec, 4);
  drive(harness, robot.robot_id, machine, [&](int ended) {
    if (ended == 5) harness.restart();  // the learned state survives a restart of the daemon
  });

  // Each mission reports the payload as far as its motion shows it, and an undeclared one is an event.
  const auto missions = harness.missions();
  ASSERT_EQ(missions.size(), 16u);
  std::size_t carried = 0, flagged = 0;
  for (std::size_t k = 0; k < missions.size(); ++k) {
    const json findings = json::parse(missions[k].findings_json);
    const double truth_kg = machine.finished()[k].undeclared_kg;
    const std::string verdict = findings["payload"]["verdict"];
    carried += truth_kg > 0;
    flagged += verdict == "undeclared";
    EXPECT_EQ(verdict == "undeclared", truth_kg > 0) << k;
    EXPECT_NEAR(findings["payload"]["undeclared_kg"].get<double>(), truth_kg,
                4 * findings["payload"]["undeclared_sd_kg"].get<double>());
  }
  EXPECT_GT(carried, 0u);
  std::size_t told = 0;
  const auto events = harness.store->events(0, 100, {.robot_ids = {robot.robot_id}}).value();
  for (const history::Event& event : events) told += event.kind == "undeclared_payload";
  EXPECT_EQ(told, flagged);

  ASSERT_FALSE(harness.candidates.empty());
  const history::Proposal newest = harness.candidates.back();
  EXPECT_EQ(newest.kind, "calibration");
  const auto refined = robot::parse_robot(newest.model_json);
  ASSERT_TRUE(refined) << describe(refined.error());
  for (std::size_t side : {0u, 1u})
    EXPECT_NEAR(refined->motor.friction_torque_nm[side], 1.3 * robot.motor.friction_torque_nm[side],
                0.03 * robot.motor.friction_torque_nm[side]);
  EXPECT_NEAR(refined->idle_power_w, robot.idle_power_w + 3, 0.5);
  const json detail = json::parse(newest.detail_json);
  for (const json& p : detail["parameters"]) EXPECT_NE(p["name"], "mass_kg") << newest.detail_json;

  history::Writer writer(*harness.store, history::WriterOptions{});
  const DriftView drift(*harness.store, harness.models, {});
  const Parts parts{*harness.store, writer, harness.models, drift, [] { return 42; }};
  ModelAdoption adoption(parts, AdoptionOptions{});
  std::vector<std::string> warnings;
  ReviewOptions options;
  options.warn = [&](const std::string&, const std::string& text) { warnings.push_back(text); };
  ProposalReview review(parts, adoption, options);
  // A candidate that would make the model worse is not stored.
  history::Proposal worse = newest;
  json model = json::parse(newest.model_json);
  model["idle_power_w"] = 500;
  worse.model_json = model.dump();
  review.suggest(worse);
  EXPECT_EQ(review.look(), 0);
  const auto stored = [&] {
    return harness.store->proposals(robot.robot_id, history::whole_future, 10).value();
  };
  EXPECT_TRUE(stored().empty());
  // One that improves it is stored with its test. The same again is no better.
  for (const int made : {1, 0}) {
    review.suggest(newest);
    EXPECT_EQ(review.look(), made) << (warnings.empty() ? "" : warnings.front());
    ASSERT_EQ(stored().size(), 1u);
    EXPECT_EQ(stored()[0].state, history::ProposalState::open);
    EXPECT_TRUE(json::parse(stored()[0].detail_json)["back_test"].contains("error_after"));
  }
  review.mission_ended(robot.robot_id);
  EXPECT_EQ(review.look(), 0);
  EXPECT_EQ(stored()[0].state, history::ProposalState::open);
  // One that no longer improves the model is dismissed with the reason.
  ASSERT_TRUE(writer.execute(history::AddProposal{worse}));
  review.mission_ended(robot.robot_id);
  EXPECT_EQ(review.look(), 0);
  EXPECT_EQ(stored()[0].state, history::ProposalState::dismissed);
  ASSERT_TRUE(writer.flush());
  const auto dismissed = harness.store->events(0, 200, {.robot_ids = {robot.robot_id}}).value();
  EXPECT_EQ(dismissed.back().kind, "proposal_dismissed");
  EXPECT_NE(dismissed.back().detail_json.find("no longer improves"), std::string::npos)
      << dismissed.back().detail_json;
  EXPECT_EQ(harness.models.find(robot.robot_id)->version, 1);
  options.automatic = true;
  ProposalReview automatic(parts, adoption, options);
  automatic.suggest(newest);
  EXPECT_EQ(automatic.look(), 1) << (warnings.empty() ? "" : warnings.front());
  EXPECT_EQ(stored()[0].state, history::ProposalState::adopted);
  // Half of the missions is held out of the fit for the test.
  const json evidence = json::parse(harness.store->model(robot.robot_id)->evidence_json)["back_test"];
  EXPECT_GE(evidence["missions"].size(), 4u);
  const double before = evidence["error_before"], after = evidence["error_after"];
  std::printf("energy error on %zu missions not fitted: %.1f %% before, %.1f %% after\n",
              evidence["missions"].size(), 1e2 * before, 1e2 * after);
  EXPECT_LT(after, 0.5 * before);
  EXPECT_EQ(harness.models.find(robot.robot_id)->version, 2);
  // A robot keeps its siblings when its refined model is adopted.
  robot::RobotModel sibling = robot;
  sibling.robot_id = "sibling";
  EXPECT_EQ(robot::kind_of(sibling), robot::kind_of(harness.models.find(robot.robot_id)->robot));
}

// Estimates under a model without the effect would count the effect twice.
TEST(RefinedModel, AdoptedEffectsRestartTraining) {
  const auto shipped = virtual_robot::shipped_robots()[0];
  robot::RobotModel robot = robot::parse_robot(shipped.json_text).value();
  testing::PipelineHarness harness;
  harness.add_version(robot, 1);
  bool proposed = false;
  virtual_robot::VirtualRobot machine(rubbing(shipped.json_text), 4);
  drive(harness, robot.robot_id, machine, [&](int ended) {
    if (ended != 8) return;
    proposed = !harness.candidates.empty();
    harness.candidates.clear();
    robot.effects = {{"coulomb_friction", {{"ratio", 0.3}}}};
    harness.add_version(robot, 2);
  });
  ASSERT_EQ(harness.missions().back().model_version, 2);
  EXPECT_TRUE(proposed);
  EXPECT_TRUE(harness.candidates.empty());
}

}  // namespace
}  // namespace joulecast::server
