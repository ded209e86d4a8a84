#pragma once

#include <limits>
#include <string>
#include <string_view>

namespace joulecast {

// The interval that a number must lie in; infinite ends are no bound. Not-a-number lies in none.
struct Bounds {
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  bool exclusive_minimum = false;
  bool exclusive_maximum = false;

  bool contain(double value) const {
    return (exclusive_minimum ? value > minimum : value >= minimum) &&
           (exclusive_maximum ? value < maximum : value <= maximum);
  }
};
inline constexpr Bounds positive{0, std::numeric_limits<double>::infinity(), true};
inline constexpr Bounds not_negative{0};
inline constexpr Bounds fraction{0, 1};

// "must be greater than 0 kg and at most 100000 kg"; without any bound "must be a finite number".
std::string requirement(const Bounds& bounds, std::string_view unit = {});
// "is -2 kg, must be greater than 0 kg and at most 100000 kg"
std::string out_of_bounds(double value, const Bounds& bounds, std::string_view unit = {});

}  // namespace joulecast
