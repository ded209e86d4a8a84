#include <gtest/gtest.h>

#include <stack>
#include <string>

#include "client/exploration_drawing.h"
#include "client/svg.h"

namespace joulecast::client {
namespace {

// Every tag closed in order, attributes quoted: enough of XML for what the writer emits.
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

TEST(Svg, EscapesTextAndStaysWellFormed) {
  Svg svg(100, 50, "a < b & \"c\"");
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

TEST(ExplorationDrawing, NumbersEveryLookAndRepeatsItself) {
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

}  // namespace
}  // namespace joulecast::client
