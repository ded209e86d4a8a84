#include "report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "base/xml_text.h"
#include "dynamics/catalogue.h"
#include "gap/traits.h"
#include "gap/verdict/text.h"

namespace joulecast::report {
namespace {

using namespace gap;

using ::testing::HasSubstr;
using ::testing::IsEmpty;
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
  for (const double x : {0.0, 2.0, 4.0, 6.0}) d.figures.floor.push_back({x, 0, 78.4, 11.3, 37});
  d.figures.stretch_of = "tour";
  for (const double t : {0.0, 1.0, 2.0, 3.0, 4.0, 5.0}) d.figures.power.push_back({t, 200, 150, 190});
  d.figures.missions = {{"tour", 1'769'853'600'000'000, 612, 23.4, 0.3361, 0.0447, 0.2411, 0.0683}};
  return d;
}

robot::RobotModel robot_model() {
  robot::RobotModel robot;
  robot.robot_id = "amr";
  robot.kinematics = {.wheel_radius_m = 0.0953, .half_track_m = 0.2747};
  robot.mass.chassis_kg = 39.1;
  robot.motor.friction_torque_nm = {0.842, 0.857};
  robot.idle_power_w = 22.6;
  return robot;
}

std::string html_of(const Diagnosis& d) {
  return report_html(d, robot_model(), {{"a.lcmlog"}, "amr.json", "", ""});
}

// The numbers of a text with the place of their last digit, without digits inside words.
struct Number {
  double value = 0, last_place = 1;
};
std::vector<Number> numbers_in(std::string text) {
  constexpr std::string_view minus = "−";
  for (auto at = text.find(minus); at != std::string::npos; at = text.find(minus, at))
    text.replace(at, minus.size(), "-");
  const auto digit = [&](std::size_t k) {
    return k < text.size() && std::isdigit(static_cast<unsigned char>(text[k])) != 0;
  };
  std::vector<Number> numbers;
  for (std::size_t k = 0; k < text.size();) {
    if (!digit(k)) {
      ++k;
      continue;
    }
    const bool word =
        k > 0 && (std::isalnum(static_cast<unsigned char>(text[k - 1])) != 0 || text[k - 1] == '_');
    const bool negative = k > 0 && text[k - 1] == '-';
    std::size_t end = k, places = 0;
    while (digit(end)) ++end;
    if (end + 1 < text.size() && text[end] == '.' && digit(end + 1)) {
      const std::size_t point = end++;
      while (digit(end)) ++end;
      places = end - point - 1;
    }
    const double value = std::stod(text.substr(k, end - k));
    if (!word) numbers.push_back({negative ? -value : value, std::pow(10.0, -static_cast<double>(places))});
    k = end;
  }
  return numbers;
}

std::string without(std::string html, const std::string& begin, const std::string& end) {
  for (auto at = html.find(begin); at != std::string::npos; at = html.find(begin, at))
    html.erase(at, html.find(end, at) + end.size() - at);
  return html;
}

// The visible text, apart from the scales of axes.
std::string visible_text(std::string html) {
  html = without(html, "<style>", "</style>");
  html = without(html, "<text class=\"tick", "</text>");
  std::string text;
  bool tag = false;
  for (const char c : html) {
    if (c == '<') tag = true, text += ' ';
    if (!tag) text += c;
    if (c == '>') tag = false;
  }
  return text;
}

std::vector<double> values_of(const Diagnosis& d) {
  std::vector<double> v{static_cast<double>(d.missions),
                        static_cast<double>(d.samples),
                        d.energy_relative,
                        d.power_absolute_relative,
                        d.noise_floor,
                        d.detectable_share,
                        d.verdict_probability};
  const auto add = [&](std::initializer_list<double> more) { v.insert(v.end(), more); };
  for (const ChannelGap& c : d.channels) add({c.absolute_relative, c.noise_floor});
  for (const Check& c : d.checks) add({c.value, c.interval[0], c.interval[1]});
  if (const auto& b = d.baseline) {
    add({b->held_out, b->unchanged_model_held_out, b->explanation_held_out});
    for (const BaselineTerm& t : b->terms) add({t.value, t.deviation, t.model});
  }
  for (const WhereRegion& w : d.where)
    add({w.from, w.to, w.share, w.time_share, w.interval[0], w.interval[1]});
  for (const DiagnosedEffect& e : d.effects) {
    add({e.probability, e.group, e.share, e.power_w, e.varies});
    for (const DiagnosedParameter& p : e.parameters) add({p.value, p.deviation});
  }
  add({d.outside.probability, d.outside.power_w[0], d.outside.power_w[1]});
  if (const auto& s = d.shrinkage) {
    add({s->before, s->after, s->fraction, s->interval[0], s->interval[1], s->remaining_over_noise_floor});
  }
  for (const FileCorrection& c : d.corrections) add({c.file, c.fits, c.deviation});
  for (const NextDrive& n : d.next_drive) add({n.expected_log_evidence});
  for (const auto& e : d.adoptable) {
    for (const auto& [name, value] : e.parameters) add({value});
  }
  const Figures& f = d.figures;
  add({f.mean_power_w});
  for (const Figures::Map& m : f.maps) {
    for (const Figures::Bin& b : m.bins) add({b.before_w, b.after_w, static_cast<double>(b.windows)});
  }
  for (const Figures::Cell& c : f.floor) add({c.before_w, c.after_w, static_cast<double>(c.windows)});
  for (const Figures::Mission& m : f.missions)
    add({m.length_s, m.payload_kg, m.energy_before, m.energy_after, m.power_before, m.power_after});
  return v;
}

// Numbers of the report that are in neither the diagnosis nor the robot's model, directly, as per cent or as
// degrees.
std::vector<double> foreign_numbers(const std::string& html, const Diagnosis& d) {
  std::vector<double> known = values_of(d);
  const robot::RobotModel robot = robot_model();
  for (const double v :
       {robot.mass.chassis_kg, robot.kinematics.wheel_radius_m, robot.kinematics.half_track_m,
        robot.motor.friction_torque_nm[0], robot.motor.friction_torque_nm[1], robot.idle_power_w})
    known.push_back(v);
  known.push_back(95);  // per cent of intervals
  for (const DiagnosedEffect& e : d.effects) {
    const dynamics::Effect* effect = dynamics::find_effect(e.id);
    if (effect == nullptr) continue;
    const dynamics::EffectInfo& info = effect->info();
    for (const Number& n : numbers_in(std::string(info.formula) + ' ' + std::string(info.source)))
      known.push_back(n.value);
  }
  std::string text = visible_text(html);
  text = without(text, "2026-01-31", "10:00");  // start of the mission
  std::vector<double> foreign;
  for (const Number& n : numbers_in(text)) {
    const auto is_it = [&](double v) {
      const double near = 0.5 * n.last_place * (1 + 1e-9);
      return std::fabs(v - n.value) <= near || std::fabs(100 * v - n.value) <= near ||
             std::fabs(v * 180 / std::numbers::pi - n.value) <= near;
    };
    if (std::ranges::none_of(known, is_it)) foreign.push_back(n.value);
  }
  return foreign;
}

TEST(Report, ShowsOnlyItsDiagnosisNumbers) {
  const Diagnosis d = full_diagnosis();
  EXPECT_THAT(foreign_numbers(html_of(d), d), IsEmpty());
  Diagnosis other = d;
  other.shrinkage->fraction = 0.6873;
  other.effects[0].parameters[0].value = 0.02417;
  EXPECT_THAT(foreign_numbers(html_of(d), other), Not(IsEmpty())) << "numbers are not compared";
}

TEST(Report, ShowsWholeDiagnosis) {
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

TEST(Report, ShowsDegreesAfterRadians) {
  const std::string html = html_of(full_diagnosis());
  EXPECT_THAT(html, HasSubstr("0.01633 ± 0.00082 rad (0.936 ± 0.047°)"));
  EXPECT_THAT(html, HasSubstr("<td>yaw rate</td><td>0.41 to 0.59 rad/s (23.7 to 33.6°/s)"));
}

TEST(Report, NamesChecksForEveryEffect) {
  for (const dynamics::Effect* effect : dynamics::catalogue()) {
    Diagnosis d;
    d.effects = {effect_of(std::string(effect->info().id), {{"strength", "1", 0.1, 0.01}})};
    const std::string_view line = traits_of(effect->info().id).workshop;
    EXPECT_GT(line.size(), 5U) << effect->info().id;
    EXPECT_THAT(html_of(d), HasSubstr("<b>To check in the workshop:</b> " + xml_escaped(line)))
        << effect->info().id;
  }
  Diagnosis d;
  d.effects = {effect_of("covariate:driver", {{"coefficient", "W", 3, 1}})};
  EXPECT_THAT(html_of(d), Not(HasSubstr("To check in the workshop")));
}

TEST(Report, ShowsDashForUnknownValues) {
  Diagnosis d = full_diagnosis();
  for (double* v : {&d.energy_relative,
                    &d.power_absolute_relative,
                    &d.noise_floor,
                    &d.detectable_share,
                    &d.verdict_probability,
                    &d.channels[1].noise_floor,
                    &d.checks[0].value,
                    &d.checks[0].interval[0],
                    &d.baseline->held_out,
                    &d.baseline->terms[0].value,
                    &d.baseline->terms[1].deviation,
                    &d.where[0].from,
                    &d.where[0].share,
                    &d.where[0].interval[1],
                    &d.effects[0].probability,
                    &d.effects[0].group,
                    &d.effects[0].share,
                    &d.effects[0].parameters[0].value,
                    &d.effects[1].parameters[0].deviation,
                    &d.outside.probability,
                    &d.shrinkage->before,
                    &d.shrinkage->fraction,
                    &d.shrinkage->interval[0],
                    &d.corrections[0].fits,
                    &d.next_drive[0].expected_log_evidence,
                    &d.adoptable[0].parameters[0].second,
                    &d.figures.power[2].measured_w,
                    &d.figures.missions[0].payload_kg,
                    &d.figures.missions[0].energy_after})
    *v = nan;
  const std::string text = visible_text(html_of(d)), html = html_of(d);
  EXPECT_THAT(text, HasSubstr("On 17 missions no power was recorded"));
  EXPECT_THAT(html, HasSubstr("<div><b>–</b>"));
  EXPECT_THAT(html, HasSubstr("<p class=\"strength\">– "));
  for (const char* wrong : {"nan", "inf ", "–\u00a0%", "– W"}) EXPECT_THAT(text, Not(HasSubstr(wrong)));
  EXPECT_THAT(html, Not(HasSubstr("\"nan\"")));
}

TEST(Report, OmitsEmptySections) {
  const std::string html = html_of(Diagnosis{});
  for (const char* heading :
       {"Reasons for the verdict", "Checks of the recordings", "Effects for the robot file",
        "Comparison with a plain regression", "The gap of each kind", "Errors by operating condition",
        "Where on the floor", "Power over time", "What to drive next"})
    EXPECT_THAT(html, Not(HasSubstr(heading)));
  EXPECT_THAT(html, HasSubstr("No effect is named."));
  EXPECT_THAT(html, Not(HasSubstr("<svg")));
  EXPECT_THAT(html, Not(HasSubstr("<table")));
}

TEST(Report, EscapesNamesInHtml) {
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
  const std::string html = report_html(d, robot, {{bad}, bad, bad, bad});
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
  for (auto at = html.find("aria-label=\""); at != std::string::npos;
       at = html.find("aria-label=\"", at + 1)) {
    const auto end = html.find('"', at + 12);
    EXPECT_EQ(html[end + 1], '>');
  }
}

TEST(Report, IsSelfContained) {
  const std::string html = html_of(full_diagnosis());
  for (const char* outer : {"<script", "http:", "https:", "src=", "url(", "@import", "javascript:"})
    EXPECT_THAT(html, Not(HasSubstr(outer)));
  int drawings = 0;
  for (auto at = html.find("<svg"); at != std::string::npos; at = html.find("<svg", at + 1), ++drawings)
    EXPECT_THAT(html.substr(at, html.find('>', at) - at), HasSubstr("role=\"img\" aria-label=\""));
  EXPECT_EQ(drawings, 7);  // errors, shares, channels, map, floor twice, power over time
}

TEST(Report, ClosesEveryElement) {
  const std::string html = html_of(full_diagnosis());
  std::vector<std::string> open;
  for (auto at = html.find("<html"); at != std::string::npos; at = html.find('<', at + 1)) {
    const std::string tag = html.substr(at + 1, html.find('>', at) - at - 1);
    const std::string name =
        tag.substr(tag.front() == '/' ? 1 : 0, tag.find_first_of(" /", 1) - (tag.front() == '/' ? 1 : 0));
    if (name == "meta" || tag.back() == '/') continue;
    if (tag.front() != '/') {
      open.push_back(name);
      continue;
    }
    ASSERT_FALSE(open.empty()) << tag;
    ASSERT_EQ(open.back(), tag.substr(1));
    open.pop_back();
  }
  EXPECT_THAT(open, IsEmpty());
}

TEST(Report, ReportsFailedExplanation) {
  Diagnosis d = full_diagnosis();
  EXPECT_THAT(html_of(d), Not(HasSubstr("It does not stand")));
  d.baseline->explanation_held_out = 0.25;
  EXPECT_THAT(html_of(d), HasSubstr("It does not stand"));
}

}  // namespace
}  // namespace joulecast::report
