#include "server/diagnosis/model_adoption.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/diagnosis/history_of.h"

namespace joulecast::server {
namespace {

using nlohmann::json;
using testing::drive;
using testing::nomad_with_friction;
using testing::tested_on;

class ModelAdoptionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    harness_.add_version(testing::nomad(), 1);
    for (int number = 0; number < 4; ++number) keys_.push_back(drive(harness_, truth_, number));
    writer_ = std::make_unique<history::Writer>(*harness_.store, history::WriterOptions{});
    adoption_ = std::make_unique<ModelAdoption>(
        Parts{*harness_.store, *writer_, harness_.models, drift_, [] { return 42; }}, AdoptionOptions{});
  }

  AdoptionRequest candidate(double friction) const {
    AdoptionRequest request;
    request.model = nomad_with_friction(friction);
    return request;
  }

  std::vector<history::Event> events() {
    EXPECT_TRUE(writer_->flush());
    return *harness_.store->events(0, 100, {.robot_ids = {"nomad"}});
  }

  testing::PipelineHarness harness_;
  DriftView drift_{*harness_.store, harness_.models, {}};
  robot::RobotModel truth_ = nomad_with_friction(1.4);
  std::vector<history::MissionKey> keys_;
  std::unique_ptr<history::Writer> writer_;
  std::unique_ptr<ModelAdoption> adoption_;
};

TEST_F(ModelAdoptionTest, AdoptsBetterModel) {
  AdoptionRequest request = candidate(1.4);
  request.fitted_on = {keys_[0]};
  request.diagnosis_id = 7;
  request.origin = history::ModelOrigin::diagnosis;
  const auto adoption = adoption_->adopt(request);
  ASSERT_TRUE(adoption) << describe(adoption.error());
  EXPECT_TRUE(adoption->adopted) << adoption->refusal;
  EXPECT_EQ(adoption->version, 2);
  EXPECT_EQ(adoption->previous_version, 1);
  EXPECT_EQ(tested_on(*adoption), (std::vector<history::MissionKey>{keys_[1], keys_[2], keys_[3]}));
  EXPECT_EQ(adoption->left_out.excepted, 1U);
  EXPECT_GT(adoption->test.error_before, 0.05);
  EXPECT_LT(adoption->test.error_after, 0.005);
  EXPECT_EQ(harness_.models.find("nomad")->version, 2);

  const auto stored = harness_.store->model("nomad");
  ASSERT_TRUE(stored);
  EXPECT_EQ(stored->version, 2);
  EXPECT_EQ(stored->origin, history::ModelOrigin::diagnosis);
  const json evidence = json::parse(stored->evidence_json);
  EXPECT_EQ(evidence["diagnosis_id"], 7);
  EXPECT_EQ(evidence["forced"], false);
  EXPECT_EQ(evidence["back_test"]["missions"].size(), 3U);
  EXPECT_EQ(evidence["back_test"]["missions"][0]["mission_id"], "m1");
  EXPECT_EQ(evidence["back_test"]["missions"][0]["id"], keys_[1]);
  ASSERT_EQ(events().size(), 1U);
  EXPECT_EQ(events()[0].kind, "model_adopted");
}

TEST_F(ModelAdoptionTest, OmitsChargingSamples) {
  keys_.push_back(drive(harness_, truth_, 4, 2500, 1000));
  ASSERT_GT(harness_.missions().back().sample_faults["charging"], 900);
  const auto adoption = adoption_->adopt(candidate(1.4));
  ASSERT_TRUE(adoption) << describe(adoption.error());
  ASSERT_EQ(tested_on(*adoption).back(), keys_.back());
  // 3 A into the battery for 20 s are some 1,500 J, more than the drive costs.
  EXPECT_LT(std::fabs(adoption->test.runs.back().after.relative), 0.01);
  const json report = json::parse(adoption->back_test_json);
  EXPECT_GT(report["left_out"]["charging_samples"], 900);
  EXPECT_LE(report["left_out"]["charging_samples"], 1000);
}

TEST_F(ModelAdoptionTest, UsesMissionsSinceChange) {
  const robot::RobotModel worn = nomad_with_friction(2);
  for (int number = 4; number < 8; ++number) keys_.push_back(drive(harness_, worn, number));
  AdoptionRequest request = candidate(2);
  request.dry_run = true;
  request.fitted_on = {keys_[0], keys_[4], keys_[5]};  // two are too few since the change: all are used
  EXPECT_EQ(tested_on(*adoption_->adopt(request)).size(), 5U);
  request.dry_run = false;
  request.fitted_on.clear();
  const auto adoption = adoption_->adopt(request);
  ASSERT_TRUE(adoption) << describe(adoption.error());
  EXPECT_TRUE(adoption->adopted) << adoption->refusal;
  EXPECT_EQ(tested_on(*adoption), (std::vector<history::MissionKey>(keys_.begin() + 4, keys_.end())));
  EXPECT_LT(adoption->test.error_after, 0.005);
  EXPECT_EQ(json::parse(adoption->back_test_json)["since_utime_us"], harness_.missions()[4].start_utime_us);
}

TEST_F(ModelAdoptionTest, RejectsWorseModelUnlessForced) {
  AdoptionRequest request = candidate(0.5);
  const auto refused = adoption_->adopt(request);
  ASSERT_TRUE(refused) << describe(refused.error());
  EXPECT_FALSE(refused->adopted);
  EXPECT_FALSE(refused->refusal.empty());
  EXPECT_EQ(refused->test.runs.size(), 4U);
  EXPECT_EQ(harness_.models.find("nomad")->version, 1);
  EXPECT_TRUE(events().empty());
  request.force = true;
  const auto forced = adoption_->adopt(request);
  ASSERT_TRUE(forced) << describe(forced.error());
  EXPECT_TRUE(forced->adopted);
  EXPECT_EQ(json::parse(harness_.store->model("nomad")->evidence_json)["forced"], true);
}

TEST_F(ModelAdoptionTest, DryRunChangesNothing) {
  AdoptionRequest request = candidate(1.4);
  request.dry_run = true;
  const auto tested = adoption_->adopt(request);
  ASSERT_TRUE(tested) << describe(tested.error());
  EXPECT_FALSE(tested->adopted);
  EXPECT_TRUE(tested->test.improves());
  EXPECT_EQ(harness_.store->model("nomad")->version, 1);
}

TEST_F(ModelAdoptionTest, RejectsWithoutMissionsToTest) {
  AdoptionRequest request = candidate(1.4);
  request.fitted_on = keys_;
  const auto adoption = adoption_->adopt(request);
  ASSERT_TRUE(adoption) << describe(adoption.error());
  EXPECT_FALSE(adoption->adopted);
  EXPECT_NE(adoption->refusal.find("no mission to test it on"), std::string::npos);
  EXPECT_TRUE(json::parse(adoption->back_test_json)["error_before"].is_null());
  request.fitted_on.clear();
  request.since_utime_us = harness_.missions().back().start_utime_us + 1;
  EXPECT_FALSE(adoption_->adopt(request)->adopted);
}

TEST_F(ModelAdoptionTest, NamesConflictsAndUnknownRobots) {
  AdoptionRequest request = candidate(1.4);
  request.expected_version = 5;
  EXPECT_EQ(adoption_->adopt(request).error().fault, Fault::conflict);
  request.model.robot_id = "absent";
  EXPECT_EQ(adoption_->adopt(request).error().fault, Fault::not_found);
}

TEST_F(ModelAdoptionTest, ClosesAdoptedProposal) {
  history::Proposal proposal;
  proposal.robot_id = "nomad";
  proposal.kind = "calibration";
  proposal.model_json = robot::to_json_text(nomad_with_friction(1.4));
  const auto id = writer_->execute(history::AddProposal{proposal});
  ASSERT_TRUE(id) << describe(id.error());
  AdoptionRequest request = candidate(1.4);
  request.proposal_id = *id;
  request.origin = history::ModelOrigin::calibration;
  ASSERT_TRUE(adoption_->adopt(request)->adopted);
  EXPECT_EQ(harness_.store->proposal(*id)->state, history::ProposalState::adopted);
  EXPECT_EQ(harness_.store->proposal(*id)->adopted_version, 2);
}

TEST_F(ModelAdoptionTest, RecordsItsRollback) {
  ASSERT_TRUE(adoption_->adopt(candidate(1.4))->adopted);
  const auto previous = adoption_->activate("nomad", 1, "as it was");
  ASSERT_TRUE(previous) << describe(previous.error());
  EXPECT_EQ(*previous, 2);
  EXPECT_EQ(harness_.models.find("nomad")->version, 1);
  EXPECT_EQ(harness_.models.find("nomad")->robot.motor.friction_torque_nm,
            testing::nomad().motor.friction_torque_nm);
  EXPECT_EQ(events().back().kind, "model_activated");
  EXPECT_EQ(adoption_->activate("nomad", 9, "").error().fault, Fault::not_found);
}

TEST_F(ModelAdoptionTest, AdoptedModelMetersNewMissions) {
  ASSERT_TRUE(adoption_->adopt(candidate(1.4))->adopted);
  adoption_.reset();
  writer_.reset();  // a store accepts one writer, and the harness has one
  drive(harness_, truth_, 9);
  const auto mission = harness_.missions().back();
  EXPECT_EQ(mission.model_version, 2);
  EXPECT_NEAR(mission.accounts.modelled_j / mission.accounts.measured_j, 1, 0.005);
}

}  // namespace
}  // namespace joulecast::server
