#include "fuzz.h"
#include "history/sql_filter.h"

using namespace joulecast;

// An accepted cursor encodes to the input.
JOULECAST_FUZZ_TARGET(cursor) {
  const std::string_view text = testing::as_text(data, size);
  if (const auto place = history::decode_cursor("q", text))
    testing::require(history::encode_cursor("q", *place) == text);
  const auto number = [&](std::size_t from) {
    std::uint64_t value = 0;
    for (std::size_t k = from; k < from + 8 && k < size; ++k) value = value << 8 | data[k];
    return static_cast<std::int64_t>(value);
  };
  const history::CursorPlace place{number(0), number(8)};
  const auto again = history::decode_cursor(text, history::encode_cursor(text, place));
  testing::require(again && *again == place);
}
