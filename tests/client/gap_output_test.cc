#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "client/commands/option.h"
#include "client/commands/print.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/diagnosis_json.h"
#include "tests/gap/verdict/made_diagnosis.h"

namespace joulecast::client {
namespace {

using gap::testing::made_diagnosis;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::string printed(const json& diagnosis) {
  ::testing::internal::CaptureStdout();
  print_diagnosis(diagnosis);
  return ::testing::internal::GetCapturedStdout();
}

TEST(GapOutput, OmitsChannelInContradictedMissions) {
  gap::Diagnosis d = made_diagnosis();
  d.checks[0].few_missions = {2};
  EXPECT_NE(printed(gap::diagnosis_to_json(d)).find("It is reversed. It is not used there."),
            std::string::npos);
}

TEST(GapOutput, OmitsUnknownNoiseFloor) {
  gap::Diagnosis d = made_diagnosis();
  d.power = gap::PowerSource::motors;
  d.noise_floor = std::nan("");
  d.channels = {{"motor_power", 0.202, d.noise_floor}};
  d.baseline->terms.clear();
  const std::string text = printed(gap::diagnosis_to_json(d));
  EXPECT_NE(text.find("mean absolute power error 20.2 %, of the motors' power"), std::string::npos) << text;
  EXPECT_EQ(text.find("nan"), std::string::npos) << text;
  EXPECT_EQ(text.find("power by term"), std::string::npos) << text;
}

TEST(GapOutput, OmitsProbabilityOfUndecidedVerdict) {
  gap::Diagnosis d = made_diagnosis();
  for (const gap::Verdict verdict : {gap::Verdict::inconclusive, gap::Verdict::not_this_robot}) {
    d.verdict = verdict;
    EXPECT_THAT(printed(gap::diagnosis_to_json(d)),
                HasSubstr("verdict: " + std::string(gap::title_of(verdict)) + "\n"));
  }
}

// The gap of a comparison is that of the differences alone.
TEST(GapOutput, StatesCommonFitFirst) {
  json d = gap::diagnosis_to_json(made_diagnosis());
  EXPECT_THAT(printed(d), Not(HasSubstr("in common")));
  d["common"] = {"accessory_load"};
  const std::string text = printed(d);
  EXPECT_LT(
      text.find("gap and errors of the robot file: after a fit of all that the groups have in common\n"),
      text.find("gap: "));
}

TEST(GapOutput, PrintsSectionsInOrder) {
  const std::string text = printed(gap::diagnosis_to_json(made_diagnosis()));
  std::size_t at = 0;
  for (const char* next :
       {"amr-07: 12 missions, 34000 samples",
        "note: 1 message could not be read",
        "checks of the recordings:",
        "It is reversed. It is not used below.",
        "gap: +10.1 % of the measured energy; mean absolute power error 20.2 % (noise floor 3.3 %)",
        "error of other readings (noise floor): yaw_rate 5.2 %",
        "verdict: effects found (probability 93\u00a0%)",
        "These data do not distinguish slope from grade.",
        "coulomb_friction: probability 96\u00a0%, 19.5 W on average; without it 72 % of the closed gap "
        "returns",
        "ratio = 0.410 ± 0.020",
        "to check: bearings",
        "covariate:cpu_load: probability 81\u00a0%",
        "power error on held-out data: robot file 20.5 %, this diagnosis 6.4 %, linear regression 11.5 %, "
        "noise floor 3.3 %",
        "the effects close 68 % of the gap",
        "power by term          in the data   robot file  this diagnosis  unit",
        "turning                  1150 ± 12           90            1140  W/(m/s)",
        "Turning costs 1150 W per m/s; the model has 90.",
        "motor.friction_torque_nm 1.690 ± 0.030 instead of 1.2",
        "where the gap arises",
        "battery_power, phase turning: +61 % of the gap (51 to 71 %) in 17 % of the time",
        "next drive, to distinguish a from b:",
        "- drive fast (expected log evidence 7.5)"}) {
    const std::size_t found = text.find(next, at);
    ASSERT_NE(found, std::string::npos) << next << "\n" << text;
    at = found;
  }
  EXPECT_THAT(text, Not(HasSubstr("not to be adopted")));
}

TEST(GapOutput, PrintsRefusalsAndChoices) {
  gap::Diagnosis d = made_diagnosis();
  d.refusal = "the verdict is inconclusive";
  d.verdict = gap::Verdict::inconclusive;
  EXPECT_THAT(printed(gap::diagnosis_to_json(d)),
              AllOf(HasSubstr("not to be adopted: the verdict is inconclusive\n")));
}

// The header and the gap name the same source of the diagnosis.
TEST(GapOutput, SourceOfPowerIsConsistent) {
  gap::Diagnosis d = made_diagnosis();
  for (const gap::PowerSource power :
       {gap::PowerSource::battery, gap::PowerSource::motors, gap::PowerSource::none}) {
    for (const bool motors : {false, true}) {
      d.power = power;
      d.motor_channels = motors;
      const std::string text = printed(gap::diagnosis_to_json(d));
      const bool no_power = text.find("no power was recorded") != std::string::npos;
      const bool from_battery = text.find("diagnosed from battery power") != std::string::npos;
      EXPECT_EQ(no_power, power == gap::PowerSource::none);
      EXPECT_FALSE(no_power && from_battery) << text;
      EXPECT_FALSE(!motors && text.find("diagnosed from torques") != std::string::npos) << text;
    }
  }
}

TEST(GapOutput, PrintsDegreesAfterRadians) {
  gap::Diagnosis d = made_diagnosis();
  d.effects[0].parameters = {{"tilt", "rad", 0.1, 0.01}};
  d.where = {{"battery_power", "heading_rad", "", 0, 1.5707963, 0.3, 0.1, {0.2, 0.4}}};
  EXPECT_THAT(printed(gap::diagnosis_to_json(d)),
              AllOf(HasSubstr("tilt = 0.100 ± 0.010 rad (5.73 deg)"), HasSubstr("(0 to 90 deg)")));
}

// A diagnosis stored by a daemon of an earlier version.
TEST(GapOutput, ReadsEarlierDiagnosis) {
  json old = gap::diagnosis_to_json(made_diagnosis());
  for (const char* later : {"notes", "checks", "channels", "baseline", "corrections", "adoption"})
    old.erase(later);
  for (const char* later : {"power_w", "varies", "calibrates", "workshop"}) old["effects"][0].erase(later);
  for (const char* later : {"like", "power_w", "says"}) old["outside"].erase(later);
  old["shrinkage"].erase("parts");
  old["where"][0].erase("time_share");
  EXPECT_THAT(
      printed(old),
      AllOf(HasSubstr("coulomb_friction: probability 96\u00a0%; without it 72 % of the closed gap returns\n"),
            HasSubstr("phase turning: +61 % of the gap (51 to 71 %)\n")));
}

TEST(GapOutput, RefusalNamesItsOption) {
  const Error refused = of_option({Fault::conflict, "", "the verdict is outside"}, "--apply");
  EXPECT_EQ(refused.field, "--apply");
  EXPECT_THAT(refused.message, HasSubstr("--force"));
  EXPECT_EQ(exit_of(refused.fault), Exit::fault);
  const Error open = of_option(
      {Fault::conflict, "effect", "a is not distinguished from b: name the one to adopt"}, "--apply");
  EXPECT_EQ(open.field, "--effect");
  EXPECT_THAT(open.message, Not(HasSubstr("--force")));
}

}  // namespace
}  // namespace joulecast::client
