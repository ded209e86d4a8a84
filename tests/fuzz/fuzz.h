#pragma once

#include <cstdint>
#include <cstdlib>
#include <map>
#include <string_view>

// JOULECAST_FUZZ_TARGET(name) { ... } defines the target of a parser; its input is `data` of `size` bytes.
// One program holds all targets, but for libFuzzer, whose programs have one each.
#ifdef JOULECAST_LIBFUZZER
#define JOULECAST_FUZZ_TARGET(name)                                                   \
  static void fuzz_##name(const std::uint8_t* data, std::size_t size);                \
  extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) { \
    fuzz_##name(data, size);                                                          \
    return 0;                                                                         \
  }                                                                                   \
  static void fuzz_##name([[maybe_unused]] const std::uint8_t* data, [[maybe_unused]] std::size_t size)
#else
#define JOULECAST_FUZZ_TARGET(name)                                                                \
  static void fuzz_##name(const std::uint8_t* data, std::size_t size);                             \
  static const bool has_##name = joulecast::testing::targets().emplace(#name, fuzz_##name).second; \
  static void fuzz_##name([[maybe_unused]] const std::uint8_t* data, [[maybe_unused]] std::size_t size)
#endif

namespace joulecast::testing {

using Target = void (*)(const std::uint8_t* data, std::size_t size);

inline std::map<std::string_view, Target>& targets() {
  static std::map<std::string_view, Target> all;
  return all;
}

inline std::string_view as_text(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

inline void require(bool truth) {
  if (!truth) std::abort();
}

}  // namespace joulecast::testing
