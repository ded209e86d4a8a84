#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "base/text.h"

namespace joulecast {
namespace {

// Encodes by the bit pattern of the given length, whether or not that is the shortest.
std::string encode(std::uint32_t code, int length) {
  if (length == 1) return {static_cast<char>(code)};
  std::string text(static_cast<std::size_t>(length), '\0');
  for (int i = length - 1; i > 0; --i, code >>= 6) {
    text[static_cast<std::size_t>(i)] = static_cast<char>(0x80 | (code & 0x3F));
  }
  text[0] = static_cast<char>((0xF00 >> length & 0xFF) | code);
  return text;
}

int shortest(std::uint32_t code) {
  return code < 0x80 ? 1 : code < 0x800 ? 2 : code < 0x10000 ? 3 : 4;
}

// Every code point in every form that can hold it: well-formed exactly in the shortest and outside the
// surrogates.
TEST(Utf8, AcceptsEveryCodePoint) {
  constexpr std::uint32_t capacity[] = {0, 0x80, 0x800, 0x10000, 0x200000};
  for (int length = 1; length <= 4; ++length) {
    for (std::uint32_t code = 0; code < capacity[length]; ++code) {
      const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
      const bool well_formed = length == shortest(code) && !surrogate && code <= 0x10FFFF;
      ASSERT_EQ(is_utf8(encode(code, length)), well_formed) << "U+" << std::hex << code << " in " << length;
    }
  }
}

TEST(Utf8, RejectsBrokenSequences) {
  EXPECT_TRUE(is_utf8(""));
  EXPECT_TRUE(is_utf8("a\xC3\xBC\xE2\x82\xACz"));
  for (const char* bad :
       {"\x80", "\xC3", "\xC3(", "\xE2\x82", "\xE2(\xAC", "\xF0\x9F\x98", "\xFF", "\xF8\x88\x80\x80\x80"}) {
    EXPECT_FALSE(is_utf8(bad)) << bad;
  }
}

}  // namespace
}  // namespace joulecast
