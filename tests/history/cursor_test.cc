#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "history/sql_filter.h"

namespace joulecast::history {
namespace {

RC_GTEST_PROP(Cursor, RestoresEveryPlace, (const std::string& query, std::int64_t a, std::int64_t b)) {
  const auto place = decode_cursor(query, encode_cursor(query, {a, b}));
  RC_ASSERT(place.has_value());
  RC_ASSERT(*place == (CursorPlace{a, b}));
}

RC_GTEST_PROP(Cursor, IsOfUrlSafeCharacters, (std::int64_t a, std::int64_t b)) {
  for (const char c : encode_cursor("missions", {a, b}))
    RC_ASSERT((c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' ||
              c == '_');
}

TEST(Cursor, RefusesAnyChangedCharacter) {
  const std::string cursor = encode_cursor("missions", {1'700'000'000'000'000, 42});
  for (std::size_t at = 0; at < cursor.size(); ++at)
    for (const char c : {'A', 'z', '5', '-', '=', ' ', '\0'}) {
      if (cursor[at] == c) continue;
      std::string changed = cursor;
      changed[at] = c;
      const auto place = decode_cursor("missions", changed);
      ASSERT_FALSE(place) << at << c;
      EXPECT_EQ(place.error().fault, Fault::invalid);
      EXPECT_EQ(place.error().field, "cursor");
    }
}

TEST(Cursor, RejectsForeignAndMalformedCursors) {
  const std::string cursor = encode_cursor("missions of amr-1", {1, 2});
  EXPECT_FALSE(decode_cursor("missions of amr-2", cursor));
  EXPECT_FALSE(decode_cursor("missions of amr-1", cursor + "A"));
  EXPECT_FALSE(decode_cursor("missions of amr-1", cursor.substr(1)));
  EXPECT_FALSE(decode_cursor("missions of amr-1", ""));
}

}  // namespace
}  // namespace joulecast::history
