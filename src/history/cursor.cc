#include "history/cursor.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "base/text.h"

namespace joulecast::history {
namespace {

constexpr std::size_t digits = 16;  // of a number

}  // namespace

std::string encode_cursor(std::string_view query, CursorPlace place) {
  const std::string numbers = fmt::format("{:016x}{:016x}", static_cast<std::uint64_t>(place[0]),
                                          static_cast<std::uint64_t>(place[1]));
  return numbers + fmt::format("{:016x}", fnv1a(numbers, fnv1a(query)));
}

Result<CursorPlace> decode_cursor(std::string_view query, std::string_view cursor) {
  CursorPlace place{};
  std::size_t at = 0;
  for (std::int64_t& number : place) {
    const std::string_view text = cursor.substr(std::min(at, cursor.size()), digits);
    std::uint64_t value = 0;
    std::from_chars(text.data(), text.data() + text.size(), value, 16);
    number = static_cast<std::int64_t>(value);
    at += digits;
  }
  if (encode_cursor(query, place) == cursor) return place;
  return invalid("cursor",
                 "is not a cursor of this query: take it from the page before, with the same filter");
}

}  // namespace joulecast::history
