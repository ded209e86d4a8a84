#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "gap/verdict/diagnosis_json.h"
#include "server/diagnosis/model_adoption.h"
#include "tests/gap/verdict/made_diagnosis.h"
#include "tests/ingest/harness.h"
#include "tests/support/sample_robots.h"

namespace joulecast::server {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class DiagnosedModelTest : public ::testing::Test {
 protected:
  DiagnosedModelTest() { harness_.add_version(testing::nomad(), 1); }

  static history::DiagnosisRecord record_of(const std::string& result) {
    history::DiagnosisRecord record;
    record.robot_id = "nomad";
    record.model_version = 1;
    record.result_json = result;
    return record;
  }
  static history::DiagnosisRecord record_of(const gap::Diagnosis& d) {
    return record_of(gap::diagnosis_to_json(d).dump());
  }
  Error refused(const history::DiagnosisRecord& record, const gap::Choice& choice = {}) {
    const auto model = diagnosed_model(*harness_.store, record, choice);
    EXPECT_FALSE(model);
    return model ? Error{} : model.error();
  }

  testing::PipelineHarness harness_;
};

TEST_F(DiagnosedModelTest, ReturnsDiagnosedEffects) {
  const auto found = diagnosed_model(*harness_.store, record_of(gap::testing::made_diagnosis()), {});
  ASSERT_TRUE(found) << describe(found.error());
  ASSERT_EQ(found->model.effects.size(), 1U);
  EXPECT_EQ(found->model.effects[0].id, "coulomb_friction");
  EXPECT_EQ(found->overridden, "");
}

TEST_F(DiagnosedModelTest, KeepsRefusalReasonDespiteForce) {
  gap::Diagnosis d = gap::testing::made_diagnosis();
  d.verdict = gap::Verdict::inconclusive;
  d.refusal = "the held-out error falls by 0.3 % of power, less than 1 %";
  const Error error = refused(record_of(d));
  EXPECT_EQ(error.fault, Fault::conflict);
  EXPECT_EQ(error.field, "/diagnosis_id");
  EXPECT_THAT(error.message, HasSubstr(d.refusal + ". To adopt it anyway, set force."));
  const auto forced = diagnosed_model(*harness_.store, record_of(d), {{}, true});
  ASSERT_TRUE(forced) << describe(forced.error());
  EXPECT_EQ(forced->overridden, d.refusal);
}

TEST_F(DiagnosedModelTest, TakesChoiceInGroup) {
  gap::Diagnosis d = gap::testing::made_diagnosis();
  d.effects[0].alternatives = {"viscous_friction"};
  const auto chosen = diagnosed_model(*harness_.store, record_of(d), {{"coulomb_friction"}, false});
  ASSERT_TRUE(chosen) << describe(chosen.error());
  EXPECT_EQ(chosen->overridden, "");
  EXPECT_EQ(refused(record_of(d), {{"coulomb_friction", "slope"}, false}).fault, Fault::invalid);
}

TEST_F(DiagnosedModelTest, RefusesRecordsWithoutOffer) {
  EXPECT_EQ(refused(record_of(std::string())).message, "holds nothing to adopt");
  EXPECT_EQ(refused(record_of("[]")).fault, Fault::corrupt);
}

}  // namespace
}  // namespace joulecast::server
