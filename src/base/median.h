#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace joulecast {

// The middle value, of an even number the upper of the two in the middle; `values` must not be empty.
template <class T>
T upper_median(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace joulecast
