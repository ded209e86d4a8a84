#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stack>
#include <string>

#include "report/report.h"
#include "tests/study/exploration/exploration_drawing.h"
#include "tests/study/exploration/svg.h"

namespace joulecast::report {
namespace {

// Checks that tags are closed in order and attributes are quoted.
void expect_well_formed(const std::string& text) {
  std::stack<std::string> open;
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1)) {
    const std::size_t end = text.find('>', at);
    ASSERT_NE(end, std::string::npos);
    const std::string tag = text.substr(at + 1, end - at - 1);
    ASSERT_EQ(tag.find('<'), std::string::npos) << tag;
    if (tag[0] == '/') {
      ASSERT_FALSE(open.empty());
      EXPECT_EQ(open.top(), tag.substr(1));
      open.pop();
    } else if (tag.back() != '/') {
      open.push(tag.substr(0, tag.find(' ')));
    }
  }
  EXPECT_TRUE(open.empty());
}

TEST(Svg, EscapesTextInSvg) {
  Svg svg = Svg::document(100, 50, "a < b & \"c\"");
  svg.text({1, 2}, "<script>\x01&</script>");
  svg.begin_clip(0, 0, 10, 10);
  svg.line({0, 0}, {-0.001, 1.0 / 3}, {.stroke = "#000"});
  svg.end_clip();
  const std::string text = svg.str();
  expect_well_formed(text);
  EXPECT_NE(text.find("a &lt; b &amp; &quot;c&quot;"), std::string::npos);
  EXPECT_EQ(text.find("<script>"), std::string::npos);
  EXPECT_EQ(text.find('\x01'), std::string::npos);
  EXPECT_NE(text.find("x2=\"0\" y2=\"0.33\""), std::string::npos);
}

TEST(ExplorationDrawing, NumbersEveryLook) {
  for (int number = 1; number <= exploration::thesis_case_count; ++number) {
    const auto map = *exploration::thesis_case(number);
    const auto explored = *exploration::explore(map);
    const std::string drawing = draw_exploration("case & title", map, explored, {});
    expect_well_formed(drawing);
    EXPECT_EQ(drawing, draw_exploration("case & title", map, explored, {}));
    for (std::size_t k = 1; k <= explored.rounds.size(); ++k)
      EXPECT_NE(drawing.find(">Look " + std::to_string(k) + ":"), std::string::npos);
  }
}

using nlohmann::json;

json columns(double energy_j) {
  return {{"time_s", {0, 1, 2}},
          {"speed_m_s", {0, 1, 0}},
          {"yaw_rate_rad_s", {0, 0, 0}},
          {"power_w", {5, 9, nullptr}},
          {"energy_j", {0, 7, energy_j}}};
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

TEST(ProfileDrawing, DrawsPlanAndBaselines) {
  json answer{{"robot_id", "amr"}, {"energy_j", 10.0},  {"distance_m", 1.0},
              {"turned_rad", 0},   {"duration_s", 2.0}, {"profile", columns(10)}};
  answer["baselines"]["trapezoid"] = {
      {"energy_j", 12.5}, {"saving_fraction", 0.2}, {"within_limits", false}, {"profile", columns(12.5)}};
  answer["baselines"]["triangle"] = {{"energy_j", 13.0}, {"saving_fraction", 0.23}};
  const auto drawing = draw_answer(answer);
  ASSERT_TRUE(drawing) << describe(drawing.error());
  expect_well_formed(*drawing);
  EXPECT_EQ(count(*drawing, "triangle, as"), 0u);
  EXPECT_EQ(count(*drawing, "nan"), 0u);
  for (const char* words : {"amr: 1.00 m", "least energy: 10.0 J", "time, s",
                            "trapezoid, as long on every run: 12.5 J; the plan saves 20.0 % (breaks"})
    EXPECT_GT(count(*drawing, words), 0u) << words;
  answer["baselines"]["triangle"] = nullptr;
  EXPECT_EQ(draw_answer(answer), drawing);
}

TEST(ProfileDrawing, DrawsMotionsInEveryPanel) {
  json answer{{"profile", columns(10)}};
  answer["baselines"]["trapezoid"]["profile"] = {{"time_s", {0, 3}},
                                                 {"speed_m_s", {0, 0}},
                                                 {"yaw_rate_rad_s", {0, 0}},
                                                 {"power_w", {5, 5}},
                                                 {"energy_j", {0, 11}}};
  const std::string straight = draw_answer(answer).value();
  EXPECT_EQ(count(straight, "<polyline"), 2u * 3u);
  for (const char* words : {"speed, m/s", "power from the battery, W", "energy from the battery, J"})
    EXPECT_GT(count(straight, words), 0u) << words;
  EXPECT_EQ(count(straight, "yaw rate"), 0u);
  answer["profile"]["yaw_rate_rad_s"][1] = 0.5;
  EXPECT_EQ(count(draw_answer(answer).value(), "<polyline"), 2u * 4u);
  answer["profile"]["speed_m_s"][1] = 0;
  const std::string turn = draw_answer(answer).value();
  EXPECT_EQ(count(turn, "<polyline"), 2u * 3u);
  EXPECT_EQ(count(turn, "speed, m/s"), 0u);
}

TEST(ProfileDrawing, RejectsAnswerWithoutColumns) {
  json answer{{"robot_id", "amr"}, {"energy_j", 10.0}};
  EXPECT_EQ(draw_answer(answer).error().fault, Fault::corrupt);
  answer["profile"] = columns(10);
  answer["profile"]["power_w"] = {1, 2};
  EXPECT_EQ(draw_answer(answer).error().fault, Fault::corrupt);
}

TEST(ProfileDrawing, EscapesItsTexts) {
  const std::string text =
      draw_answer({{"robot_id", "<script> a < b & \"c\"\x01"}, {"profile", columns(10)}}).value();
  expect_well_formed(text);
  EXPECT_NE(text.find("&lt;script&gt; a &lt; b &amp; &quot;c&quot;:"), std::string::npos);
  EXPECT_EQ(text.find("<script>"), std::string::npos);
}

}  // namespace
}  // namespace joulecast::report
