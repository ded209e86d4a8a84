#include "gap/verdict/diagnosis_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "gap/traits.h"
#include "gap/verdict/text.h"
#include "tests/gap/verdict/made_diagnosis.h"
#include "tests/support/schema_check.h"

namespace joulecast::gap {
namespace {

using joulecast::testing::SchemaCheck;
using nlohmann::json;
using ::testing::IsEmpty;
using testing::made_diagnosis;

TEST(DiagnosisJson, ListsAffectedMissions) {
  Diagnosis d = made_diagnosis();
  d.checks[0].few_missions = {2, 5};
  const auto checks = diagnosis_to_json(d)["checks"];
  EXPECT_EQ(checks[0]["few_missions"], json({2, 5}));
  EXPECT_FALSE(checks[1].contains("few_missions"));
}

TEST(DiagnosisJson, ContainsEveryField) {
  const Diagnosis d = made_diagnosis();
  const json told = diagnosis_to_json(d);
  const json wanted = {
      {"robot_id", "amr-07"},
      {"model_version", nullptr},
      {"missions", 12},
      {"samples", 34'000},
      {"notes", {"1 message could not be read"}},
      {"motor_channels", true},
      {"power", "motors"},
      {"checks",
       {{{"id", "battery_current_reversed"},
         {"channel", "battery_current"},
         {"value", -1.02},
         {"interval", {-1.05, -0.99}},
         {"says", "It is reversed."},
         {"contradicted", true}},
        {{"id", "step_between_missions"},
         {"channel", nullptr},
         {"value", 1.3},
         {"interval", {nullptr, nullptr}},
         {"says", "It changes."},
         {"contradicted", false},
         {"first_mission", 4}}}},
      {"gap",
       {{"energy_relative", 0.101},
        {"power_absolute_relative", 0.202},
        {"noise_floor", 0.033},
        {"detectable_share", 0.014}}},
      {"channels",
       {{"battery_power", {{"absolute_relative", 0.21}, {"noise_floor", 0.031}}},
        {"yaw_rate", {{"absolute_relative", 0.052}, {"noise_floor", nullptr}}}}},
      {"verdict", "effects"},
      {"verdict_title", "effects found"},
      {"verdict_probability", 0.93},
      {"reasons", {"These data do not distinguish slope from grade."}},
      {"effects",
       {{{"id", "coulomb_friction"},
         {"probability", 0.96},
         {"parameters",
          {{"ratio", {{"value", 0.41}, {"sd", 0.02}, {"unit", "1"}}},
           {"place", {{"value", 3.5}, {"sd", nullptr}, {"unit", "m"}}}}},
         {"share", 0.72},
         {"alternatives", json::array()},
         {"group", 0.99},
         {"power_w", 19.5},
         {"varies", 0.11},
         {"calibrates", "/motor/friction_torque_nm"},
         {"workshop", traits_of("coulomb_friction").workshop}},
        {{"id", "covariate:cpu_load"},
         {"probability", 0.81},
         {"parameters", {{"coefficient", {{"value", 33.0}, {"sd", 3.0}, {"unit", "W/1"}}}}},
         {"share", 0.13},
         {"alternatives", json::array()},
         {"group", 0.82},
         {"power_w", 0.0},
         {"varies", 0.0},
         {"calibrates", nullptr},
         {"workshop", nullptr}}}},
      {"outside",
       {{"probability", 0.22},
        {"channel", "wheel_torque"},
        {"follows", "time"},
        {"like", "accessory_load"},
        {"power_w", {4000.0, 1000.0}},
        {"says", outside_words(d.outside)}}},
      {"shrinkage",
       {{"held_out_before", 0.203},
        {"held_out_after", 0.065},
        {"fraction", 0.68},
        {"ci", {0.61, 0.74}},
        {"remaining_over_noise_floor", 1.97},
        {"parts", 5}}},
      {"baseline",
       {{"terms",
         {{"turning",
           {{"value", 1150.0}, {"sd", 12.0}, {"unit", "W/(m/s)"}, {"model", 90.0}, {"explained", 1140.0}}},
          {"constant",
           {{"value", 80.0}, {"sd", nullptr}, {"unit", "W"}, {"model", nullptr}, {"explained", nullptr}}}}},
        {"held_out", 0.115},
        {"unchanged_model_held_out", 0.205},
        {"explanation_held_out", 0.064},
        {"deviation", 0.004},
        {"wins", false},
        {"says", {"Turning costs 1150 W per m/s; the model has 90."}}}},
      {"sums",
       {{{"of", {"accessory_load", "coulomb_friction"}},
         {"terms", "constant + |v|"},
         {"value", 12.5},
         {"sd", 0.4},
         {"unit", "W"},
         {"adopts_as", "idle_power_w"},
         {"fits", {{"value", 20.5}, {"sd", 0.4}, {"unit", "W"}}}}}},
      {"corrections",
       {{{"parameter", "motor.friction_torque_nm"}, {"file", 1.2}, {"fits", 1.69}, {"sd", 0.03}}}},
      {"where",
       {{{"channel", "battery_power"},
         {"variable", "phase"},
         {"from", "turning"},
         {"to", "turning"},
         {"share", 0.61},
         {"ci", {0.51, 0.71}},
         {"time_share", 0.17}},
        {{"channel", "wheel_torque"},
         {"variable", "speed_m_s"},
         {"from", 0.2},
         {"to", 0.4},
         {"share", -0.12},
         {"ci", {-0.19, -0.05}},
         {"time_share", 0.09}}}},
      {"next_drive",
       {{{"manoeuvre", "drive fast"}, {"separates", "a from b"}, {"expected_log_evidence", 7.5}},
        {{"manoeuvre", "drive slowly"}, {"separates", "c from d"}, {"expected_log_evidence", nullptr}}}},
      {"adoption",
       {{"refusal", nullptr},
        {"corrects_file", false},
        {"effects",
         {{{"id", "coulomb_friction"}, {"parameters", {{"ratio", 0.41}}}, {"instead", json::array()}}}}}}};
  EXPECT_EQ(told, wanted) << json::diff(wanted, told).dump(1);
}

TEST(DiagnosisJson, MatchesSchemaFullAndEmpty) {
  const SchemaCheck schema(diagnosis_schemas());
  EXPECT_THAT(schema.faults(diagnosis_to_json(made_diagnosis())), IsEmpty());
  Diagnosis nothing;
  nothing.power_absolute_relative = nothing.energy_relative = nothing.noise_floor = testing::unknown;
  const json told = diagnosis_to_json(nothing);
  EXPECT_THAT(schema.faults(told), IsEmpty());
  EXPECT_EQ(told["gap"]["noise_floor"], nullptr);
  EXPECT_EQ(told["baseline"], nullptr);
  EXPECT_EQ(told["outside"]["says"], nullptr);
  json wrong = told;
  wrong["verdict"] = "perhaps";
  wrong["outside"].erase("channel");
  wrong["surprise"] = 1;
  EXPECT_EQ(schema.faults(wrong).size(), 3U);
}

TEST(DiagnosisJson, KeepsErrorWithoutShrinkage) {
  Diagnosis d = made_diagnosis();
  d.shrinkage.reset();
  const json told = diagnosis_to_json(d)["shrinkage"];
  EXPECT_EQ(told["held_out_before"], d.power_absolute_relative);
  EXPECT_EQ(told["held_out_after"], d.power_absolute_relative);
  EXPECT_EQ(told["fraction"], 0);
  EXPECT_DOUBLE_EQ(told["remaining_over_noise_floor"], d.power_absolute_relative / d.noise_floor);
}

TEST(DiagnosisJson, OrdersChecksBeforeAdoption) {
  const nlohmann::ordered_json told = diagnosis_to_json(made_diagnosis());
  std::vector<std::string> names;
  for (const auto& [name, value] : told.items()) names.push_back(name);
  const auto place = [&](std::string_view name) { return std::ranges::find(names, name) - names.begin(); };
  EXPECT_LT(place("checks"), place("gap"));
  EXPECT_LT(place("verdict"), place("effects"));
  EXPECT_LT(place("where"), place("adoption"));
}

}  // namespace
}  // namespace joulecast::gap
