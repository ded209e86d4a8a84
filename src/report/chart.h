#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "report/svg.h"

namespace joulecast::report {

// Two axes and the drawing between them, within a box of a picture. Colours come from a style sheet by class
// names. Values beyond the axes are drawn at their ends.
class Chart {
 public:
  struct Axis {
    double low = 0, high = 1;
    std::string label;
  };
  struct Box {
    double left, top, width, height;  // px, with room for the axes
  };
  Chart(Svg& svg, Box box, Axis x, Axis y);

  void line(std::span<const SvgPoint> points, std::string_view style);  // interrupted where a y is not finite
  void level(double y, std::string_view style);

 private:
  double px(double x) const;
  double py(double y) const;

  Svg& svg_;
  Box box_;  // between the axes
  Axis x_, y_;
};

// Round values that span a range.
std::vector<double> ticks_of(double low, double high, int about);

}  // namespace joulecast::report
