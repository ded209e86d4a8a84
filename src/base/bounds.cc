#include "base/bounds.h"

#include <fmt/format.h>

#include <cmath>

namespace joulecast {
namespace {

std::string with_unit(double value, std::string_view unit) {
  return unit.empty() || unit == "1" ? fmt::format("{}", value) : fmt::format("{} {}", value, unit);
}

}  // namespace

std::string requirement(const Bounds& bounds, std::string_view unit) {
  std::string text;
  if (std::isfinite(bounds.minimum))
    text = fmt::format("{} {}", bounds.exclusive_minimum ? "greater than" : "at least",
                       with_unit(bounds.minimum, unit));
  if (std::isfinite(bounds.maximum))
    text += fmt::format("{}{} {}", text.empty() ? "" : " and ",
                        bounds.exclusive_maximum ? "less than" : "at most", with_unit(bounds.maximum, unit));
  return "must be " + (text.empty() ? "a finite number" : text);
}

std::string out_of_bounds(double value, const Bounds& bounds, std::string_view unit) {
  return fmt::format("is {}, {}", with_unit(value, unit), requirement(bounds, unit));
}

}  // namespace joulecast
