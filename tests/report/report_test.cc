#include "report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "gap/verdict/diagnosis_json.h"
#include "robot/robot_file.h"

namespace joulecast::report {
namespace {

using namespace gap;

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

DiagnosedEffect effect_of(std::string id, std::vector<DiagnosedParameter> parameters) {
  DiagnosedEffect e;
  e.id = std::move(id);
  e.parameters = std::move(parameters);
  return e;
}

Diagnosis full_diagnosis() {
  Diagnosis d;
  d.robot_id = "amr";
  d.missions = 17;
  d.samples = 83'211;
  d.notes = {"Mission late was left out."};
  d.energy_relative = 0.3417;
  d.power_absolute_relative = 0.2263;
  d.noise_floor = 0.0137;
  d.detectable_share = 0.0291;
  d.channels = {{"battery_power", 0.2263, 0.0137}, {"yaw_rate", 0.0743, 0.0521}};
  d.checks = {{.id = "battery_current_reversed",
               .channel = "battery_current",
               .value = -0.973,
               .interval = {-0.991, -0.955},
               .says = "The battery current has the other sign.",
               .contradicted = true}};
  d.baseline =
      Baseline{.terms = {{"constant", "W", 143.2, 6.3, 98.7}, {"speed", "W/(m/s)", 367.4, 21.8, 312.9}},
               .held_out = 0.1853,
               .unchanged_model_held_out = 0.2319,
               .explanation_held_out = 0.0647,
               .says = {"Standing costs more."}};
  d.where = {{"battery_power", "yaw_rate_rad_s", "", 0.413, 0.587, 0.613, 0.177, {0.487, 0.731}},
             {"wheel_torque", "phase", "braking", 0, 0, -0.218, 0.118, {-0.297, -0.139}}};
  d.verdict = Verdict::effects;
  d.verdict_probability = 0.927;
  d.reasons = {"A load would look alike."};
  d.effects = {{.id = "slope",
                .probability = 0.943,
                .group = 0.969,
                .parameters = {{"angle_rad", "rad", 0.01633, 0.00082}, {"uphill_rad", "rad", 2.912, nan}},
                .share = 0.557,
                .power_w = 27.9,
                .varies = 0.253,
                .alternatives = {"accessory_load"},
                .calibrates = ""}};
  d.effects.push_back(effect_of("covariate:cpu_load", {{"coefficient", "W", 8.64, 0.31}}));
  d.effects[1].probability = 0.876;
  d.effects[1].share = 0.152;
  d.outside = {.probability = 0.338,
               .channel = "battery_power_from_motion",
               .follows = "time",
               .like = "accessory_load",
               .power_w = {1934, 1071}};
  d.shrinkage = Shrinkage{.before = 0.2319,
                          .after = 0.0647,
                          .fraction = 0.721,
                          .interval = {0.633, 0.797},
                          .remaining_over_noise_floor = 4.72,
                          .parts = 9};
  d.corrections = {{"motor.friction_torque_nm", 0.842, 1.186, 0.028}};
  d.next_drive = {{"circles both ways", "slope from accessory_load", 15.9}};
  d.adoptable = {{"slope", {{"angle_rad", 0.01633}, {"uphill_rad", 2.912}}}};
  d.refusal = "slope is not distinguished from accessory_load";
  d.figures.mean_power_w = 254.3;
  d.figures.maps = {{"speed, m/s",
                     {{.from = 0,
                       .to = 0.7,
                       .before_w = 41.6,
                       .after_w = 3.87,
                       .half_width_w = 5,
                       .windows = 66,
                       .label = ""},
                      {.from = 0.7,
                       .to = 1.4,
                       .before_w = 58.8,
                       .after_w = 6.1,
                       .half_width_w = nan,
                       .windows = 49,
                       .label = ""}}}};
  d.figures.cell_m = 2;
  for (const double x : {0.0, 2.0, 4.0, 6.0}) d.figures.floor.push_back({x, 0, 78.4, 11.3, 0, 37, {}});
  d.figures.stretch_of = "tour";
  for (const double t : {0.0, 1.0, 2.0, 3.0, 4.0, 5.0}) d.figures.power.push_back({t, 200, 150, 190});
  d.figures.missions = {{"tour", 1'769'853'600'000'000, 612, 23.4, 0.3361, 0.0447, 0.2411, 0.0683}};
  return d;
}

robot::RobotModel robot_model() {
  robot::RobotModel robot;
  robot.robot_id = "amr";
  robot.kinematics = {.wheel_radius_m = 0.0953, .half_track_m = 0.2747};
  robot.idle_power_w = 22.6;
  return robot;
}

std::string html_of(const Diagnosis& d) {
  return report_html(diagnosis_to_json(d), robot_model(), {{"a.lcmlog"}, "amr.json", "", ""});
}

// The JSON that the page's script reads.
std::string data_in(const std::string& html) {
  const std::string begin = "<script type=\"application/json\" id=\"data\">";
  const auto from = html.find(begin) + begin.size();
  return html.substr(from, html.find("</script>", from) - from);
}

TEST(Report, ContainsDiagnosisAsJson) {
  const std::string html = html_of(full_diagnosis());
  const auto data = nlohmann::ordered_json::parse(data_in(html));
  EXPECT_EQ(data["result"], diagnosis_to_json(full_diagnosis()));
  EXPECT_EQ(data["robot"], nlohmann::ordered_json(robot::robot_to_json(robot_model())));
  EXPECT_EQ(data["origin"]["sources"][0], "a.lcmlog");
  EXPECT_EQ(data["origin"]["model"], "amr.json");
  EXPECT_EQ(html.find("@DATA@"), std::string::npos);
}

TEST(Report, WritesFiguresByColumn) {
  const auto f = nlohmann::json::parse(data_in(html_of(full_diagnosis())))["result"]["figures"];
  const auto& map = f["maps"][0];
  EXPECT_EQ(map["axis"], "speed, m/s");
  EXPECT_EQ(map["from"], (std::vector<double>{0, 0.7}));
  EXPECT_EQ(map["before_w"], (std::vector<double>{41.6, 58.8}));
  EXPECT_EQ(map["half_width_w"][0], 5);
  EXPECT_TRUE(map["half_width_w"][1].is_null());
  EXPECT_EQ(f["floor"]["x_m"], (std::vector<double>{0, 2, 4, 6}));
  EXPECT_EQ(f["floor"]["windows"], (std::vector<int>{37, 37, 37, 37}));
  EXPECT_EQ(f["power"]["t_s"].size(), 6U);
  EXPECT_EQ(f["missions"]["start_utime_us"][0], 1'769'853'600'000'000);
  EXPECT_EQ(f["missions"]["power_after"][0], 0.0683);
}

TEST(Report, OmitsFiguresWithoutPower) {
  EXPECT_FALSE(nlohmann::json::parse(data_in(html_of(Diagnosis{})))["result"].contains("figures"));
}

TEST(Report, ContainsWholeDiagnosis) {
  const std::vector<std::pair<const char*, std::function<void(Diagnosis&)>>> changes{
      {"robot", [](Diagnosis& d) { d.robot_id = "other"; }},
      {"missions", [](Diagnosis& d) { d.missions = 18; }},
      {"samples", [](Diagnosis& d) { d.samples = 12; }},
      {"notes", [](Diagnosis& d) { d.notes[0] = "Joined."; }},
      {"motor channels", [](Diagnosis& d) { d.motor_channels = false; }},
      {"power", [](Diagnosis& d) { d.power = PowerSource::motors; }},
      {"energy", [](Diagnosis& d) { d.energy_relative = 0.1; }},
      {"gap", [](Diagnosis& d) { d.power_absolute_relative = 0.1; }},
      {"noise floor", [](Diagnosis& d) { d.noise_floor = 0.04; }},
      {"detectable", [](Diagnosis& d) { d.detectable_share = 0.05; }},
      {"channel", [](Diagnosis& d) { d.channels[1].absolute_relative = 0.2; }},
      {"channel's floor", [](Diagnosis& d) { d.channels[1].noise_floor = 0.01; }},
      {"check", [](Diagnosis& d) { d.checks[0].says = "It is well."; }},
      {"check's value", [](Diagnosis& d) { d.checks[0].value = -1.1; }},
      {"check's weight", [](Diagnosis& d) { d.checks[0].contradicted = false; }},
      {"regression", [](Diagnosis& d) { d.baseline->held_out = 0.3; }},
      {"unchanged model", [](Diagnosis& d) { d.baseline->unchanged_model_held_out = 0.3; }},
      {"explanation", [](Diagnosis& d) { d.baseline->explanation_held_out = 0.05; }},
      {"term", [](Diagnosis& d) { d.baseline->terms[1].value = 5; }},
      {"term of the model", [](Diagnosis& d) { d.baseline->terms[1].model = 5; }},
      {"sentence of the regression", [](Diagnosis& d) { d.baseline->says[0] = "Turning costs more."; }},
      {"region", [](Diagnosis& d) { d.where[0].to = 0.9; }},
      {"region's time", [](Diagnosis& d) { d.where[0].time_share = 0.9; }},
      {"verdict", [](Diagnosis& d) { d.verdict = Verdict::inconclusive; }},
      {"its probability", [](Diagnosis& d) { d.verdict_probability = 0.5; }},
      {"reasons", [](Diagnosis& d) { d.reasons[0] = "Too short."; }},
      {"group", [](Diagnosis& d) { d.effects[0].group = 0.5; }},
      {"varies", [](Diagnosis& d) { d.effects[0].varies = 0.5; }},
      {"power of an effect", [](Diagnosis& d) { d.effects[0].power_w = 3; }},
      {"alternatives", [](Diagnosis& d) { d.effects[0].alternatives = {"grade"}; }},
      {"calibrates", [](Diagnosis& d) { d.effects[0].calibrates = "/idle_power_w"; }},
      {"outside", [](Diagnosis& d) { d.outside.power_w[1] = 400; }},
      {"correction", [](Diagnosis& d) { d.corrections[0].fits = 2; }},
      {"next drive", [](Diagnosis& d) { d.next_drive[0].manoeuvre = "ramps"; }},
      {"adoptable", [](Diagnosis& d) { d.adoptable[0].parameters[1].second = 1; }},
      {"refusal", [](Diagnosis& d) { d.refusal.clear(); }},
      {"map", [](Diagnosis& d) { d.figures.maps[0].bins[0].after_w = 20; }},
      {"floor", [](Diagnosis& d) { d.figures.floor[0].before_w = 20; }},
      {"mission of the power over time", [](Diagnosis& d) { d.figures.stretch_of = "loop"; }},
      {"power over time", [](Diagnosis& d) { d.figures.power[3].measured_w = 180; }},
      {"mission", [](Diagnosis& d) { d.figures.missions[0].power_after = 0.1; }}};
  const std::string before = html_of(full_diagnosis());
  for (const auto& [what, change] : changes) {
    Diagnosis d = full_diagnosis();
    change(d);
    EXPECT_NE(html_of(d), before) << what;
  }
}

TEST(Report, EscapesTagsInData) {
  const std::string bad = "<script>\"&'</script>";
  Diagnosis d = full_diagnosis();
  for (std::string* text : {&d.robot_id,
                            &d.notes[0],
                            &d.checks[0].id,
                            &d.checks[0].channel,
                            &d.checks[0].says,
                            &d.channels[0].channel,
                            &d.baseline->terms[0].name,
                            &d.baseline->terms[0].unit,
                            &d.baseline->says[0],
                            &d.where[0].channel,
                            &d.where[1].variable,
                            &d.where[1].label,
                            &d.reasons[0],
                            &d.effects[1].parameters[0].name,
                            &d.effects[1].parameters[0].unit,
                            &d.effects[0].alternatives[0],
                            &d.effects[0].calibrates,
                            &d.outside.like,
                            &d.corrections[0].parameter,
                            &d.next_drive[0].manoeuvre,
                            &d.next_drive[0].separates,
                            &d.adoptable[0].id,
                            &d.adoptable[0].parameters[0].first,
                            &d.refusal,
                            &d.figures.maps[0].axis,
                            &d.figures.maps[0].bins[0].label,
                            &d.figures.stretch_of,
                            &d.figures.missions[0].mission_id})
    *text = bad;
  d.effects[1].id = "covariate:" + bad;
  robot::RobotModel robot = robot_model();
  robot.robot_id = bad;
  robot.effects = {{bad, {}}};
  const std::string data = data_in(report_html(diagnosis_to_json(d), robot, {{bad}, bad, bad, bad}));
  EXPECT_THAT(data, Not(HasSubstr("<")));
  const auto parsed = nlohmann::json::parse(data);
  EXPECT_EQ(parsed["result"]["checks"][0]["says"], bad);
  EXPECT_EQ(parsed["robot"]["robot_id"], bad);
}

TEST(Report, ReplacesInvalidUtf8) {
  Diagnosis d = full_diagnosis();
  d.figures.stretch_of = "tour\xff";
  const auto data = nlohmann::json::parse(data_in(html_of(d)));
  EXPECT_EQ(data["result"]["figures"]["power"]["mission_id"], "tour\uFFFD");
}

TEST(Report, IsSelfContained) {
  const std::string html = html_of(full_diagnosis());
  for (const char* outer : {"<link", " src=", "@import", "javascript:"})
    EXPECT_THAT(html, Not(HasSubstr(outer)));
  EXPECT_TRUE(html.starts_with("<!doctype html>"));
  EXPECT_TRUE(html.ends_with("</html>\n"));
}

}  // namespace
}  // namespace joulecast::report
