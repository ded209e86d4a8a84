#pragma once

#include <cstdint>
#include <cstdlib>
#include <string_view>

namespace joulecast::testing {

inline std::string_view as_text(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

inline void require(bool truth) {
  if (!truth) std::abort();
}

}  // namespace joulecast::testing
