#pragma once

#include <array>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "report/svg.h"

namespace joulecast::report {

// Two axes and the drawing between them, within a box of a picture. Colours come from a style sheet by class
// names, so that one picture serves light and dark pages. Values beyond the axes are drawn at their ends.
class Chart {
 public:
  struct Axis {
    double low = 0, high = 1;
    std::string label;
    bool ticks = true;
    std::string_view degrees = {};  // unit of degrees shown with the axis's radians; empty: none
  };
  struct Box {
    double left, top, width, height;  // px, with room for the axes
  };
  Chart(Svg& svg, Box box, Axis x, Axis y);

  void bar(double from, double to, double base, double value, std::string_view style, std::string_view hint);
  void line(std::span<const SvgPoint> points, std::string_view style);  // interrupted where a y is not finite
  void segment(SvgPoint from, SvgPoint to, std::string_view style);
  void cell(SvgPoint low, SvgPoint high, std::string_view style, double opacity, std::string_view hint);
  void level(double y, std::string_view style);
  // A label under the x axis in the place of numbers.
  void category(double x, std::string_view text);

 private:
  double px(double x) const;
  double py(double y) const;

  Svg& svg_;
  Box box_;  // between the axes
  Axis x_, y_;
};

// Round values that span a range.
std::vector<double> ticks_of(double low, double high, int about);

struct BarRow {
  std::string label, hint;
  double value = 0;
  std::array<double, 2> interval{};  // equal ends: none
  std::string style;
  double mark = std::numeric_limits<double>::quiet_NaN();  // a reference value; NaN: none
  std::string text = {};                                   // text at its end; empty: the value
};

// Horizontal bars from zero, each under its label and with its value at its end; `unit` follows each value.
// Rows without a finite value have a dash.
std::string bars(std::span<const BarRow> rows, std::string_view unit, std::string_view name);

struct ChangeRow {
  std::string label;
  double before = 0, after = 0;
};

// One line a row: a value before and after, on a common axis with zero marked.
std::string changes(std::span<const ChangeRow> rows, std::string_view axis, std::string_view name);

}  // namespace joulecast::report
