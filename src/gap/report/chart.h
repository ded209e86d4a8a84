#pragma once

#include <array>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace joulecast::gap {

struct ChartPoint {
  double x = 0, y = 0;
};

// One inline SVG picture with two axes. Colours come from the page's style sheet by class names, so that one
// picture serves light and dark pages.
class Chart {
 public:
  struct Axis {
    double low = 0, high = 1;
    std::string label;
    bool ticks = true;
    std::string_view degrees = {};  // what degrees beside the axis's radians are called; empty: it has none
  };
  // `name` is read out by screen readers.
  Chart(double width, double height, Axis x, Axis y, std::string_view name);

  void bar(double from, double to, double base, double value, std::string_view style, std::string_view hint);
  void line(std::span<const ChartPoint> points, std::string_view style);
  void dot(ChartPoint at, std::string_view style, std::string_view hint, double radius = 3.2);
  void segment(ChartPoint from, ChartPoint to, std::string_view style);
  void cell(ChartPoint low, ChartPoint high, std::string_view style, double opacity, std::string_view hint);
  void level(double y, std::string_view style);
  // A label under the x axis in the place of numbers.
  void category(double x, std::string_view text);

  std::string str() const;

 private:
  double px(double x) const;
  double py(double y) const;

  double width_, height_;
  Axis x_, y_;
  std::string body_;
};

// Round values that span a range.
std::vector<double> ticks_of(double low, double high, int about);

struct BarRow {
  std::string label, hint;
  double value = 0;
  std::array<double, 2> interval{};  // equal ends: none
  std::string style;
  double mark = std::numeric_limits<double>::quiet_NaN();  // a value to hold it against; NaN: none
  std::string text = {};                                   // what stands at its end; empty: the value
};

// Horizontal bars from zero, each under its label and with its value at its end; `unit` follows each value.
// Rows whose value is not known have a dash.
std::string bars(std::span<const BarRow> rows, std::string_view unit, std::string_view name);

struct ChangeRow {
  std::string label;
  double before = 0, after = 0;
};

// One line a row: a value before and after, on a common axis with zero marked.
std::string changes(std::span<const ChangeRow> rows, std::string_view axis, std::string_view name);

}  // namespace joulecast::gap
