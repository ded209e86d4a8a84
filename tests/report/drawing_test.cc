#include <gtest/gtest.h>

#include <limits>
#include <stack>
#include <string>
#include <vector>

#include "report/profile_drawing.h"
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

TEST(ProfileDrawing, DrawsMotionsInEveryPanel) {
  const auto count = [](const std::string& text, const std::string& part) {
    std::size_t n = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
    return n;
  };
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  std::vector<DrawnMotion> motions{
      {"least energy: 10 J", "plan", {0, 1, 2}, {0, 1, 0}, {0, 0, 0}, {5, 9, unknown}, {0, 7, 10}},
      {"trapezoid: 11 J", "trapezoid", {0, 3}, {0, 0}, {0, 0}, {5, 5}, {0, 11}}};
  const std::string straight = draw_profile("amr: 1 m", motions);
  expect_well_formed(straight);
  EXPECT_EQ(count(straight, "<polyline"), 2u * 3u);
  EXPECT_EQ(count(straight, "nan"), 0u);
  for (const char* words : {"amr: 1 m", "least energy: 10 J", "trapezoid: 11 J", "speed, m/s",
                            "power from the battery, W", "energy from the battery, J", "time, s"})
    EXPECT_GT(count(straight, words), 0u) << words;
  EXPECT_EQ(count(straight, "yaw rate"), 0u);
  motions[0].yaw_rate_rad_s[1] = 0.5;
  EXPECT_EQ(count(draw_profile("amr", motions), "<polyline"), 2u * 4u);
  motions[0].speed_m_s[1] = 0;
  const std::string turn = draw_profile("amr", motions);
  EXPECT_EQ(count(turn, "<polyline"), 2u * 3u);
  EXPECT_EQ(count(turn, "speed, m/s"), 0u);
}

TEST(ProfileDrawing, EscapesItsTexts) {
  const std::string text =
      draw_profile("a < b & \"c\"\x01",
                   std::vector<DrawnMotion>{{"<script>", "plan", {0, 1}, {0, 1}, {0, 0}, {5, 9}, {0, 7}}});
  expect_well_formed(text);
  EXPECT_NE(text.find("a &lt; b &amp; &quot;c&quot;<"), std::string::npos);
  EXPECT_EQ(text.find("<script>"), std::string::npos);
}

}  // namespace
}  // namespace joulecast::report
