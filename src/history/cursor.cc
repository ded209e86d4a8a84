#include "history/cursor.h"

namespace joulecast::history {
namespace {

// A cursor is 24 bytes, little-endian: the place, then a fingerprint over query and place. 24 bytes make 32
// characters of base64url without padding.
constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
constexpr std::size_t words = 3;
constexpr std::size_t raw_bytes = 8 * words;
constexpr std::size_t text_bytes = raw_bytes / 3 * 4;

// FNV-1a, 64 bits. It detects mistakes, not forgeries: a cursor gives access to nothing that the query itself
// does not.
std::uint64_t fingerprint(std::string_view query, CursorPlace place) {
  std::uint64_t hash = 0xcbf29ce484222325;
  const auto add = [&](std::uint64_t byte) { hash = (hash ^ byte) * 0x100000001b3; };
  for (const char c : query) add(static_cast<unsigned char>(c));
  for (const std::int64_t number : place)
    for (unsigned k = 0; k < 8; ++k) add((static_cast<std::uint64_t>(number) >> (8 * k)) & 0xff);
  return hash;
}

}  // namespace

std::string encode_cursor(std::string_view query, CursorPlace place) {
  const std::array<std::uint64_t, words> numbers = {
      static_cast<std::uint64_t>(place[0]), static_cast<std::uint64_t>(place[1]), fingerprint(query, place)};
  const auto byte = [&](std::size_t k) { return (numbers[k / 8] >> (8 * (k % 8))) & 0xff; };
  std::string text;
  text.reserve(text_bytes);
  for (std::size_t k = 0; k < raw_bytes; k += 3) {
    const std::uint64_t three = byte(k) << 16 | byte(k + 1) << 8 | byte(k + 2);
    for (const unsigned shift : {18U, 12U, 6U, 0U}) text.push_back(alphabet[(three >> shift) & 0x3f]);
  }
  return text;
}

Result<CursorPlace> decode_cursor(std::string_view query, std::string_view cursor) {
  const auto refused = [] {
    return invalid("cursor",
                   "is not a cursor of this query: take it from the page before, with the same filter");
  };
  if (cursor.size() != text_bytes) return refused();
  std::array<std::uint64_t, words> numbers{};
  for (std::size_t group = 0; group < text_bytes / 4; ++group) {
    std::uint64_t three = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t digit = alphabet.find(cursor[4 * group + k]);
      if (digit == std::string_view::npos) return refused();
      three = three << 6 | digit;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t at = 3 * group + k;
      numbers[at / 8] |= ((three >> (8 * (2 - k))) & 0xff) << (8 * (at % 8));
    }
  }
  const CursorPlace place = {static_cast<std::int64_t>(numbers[0]), static_cast<std::int64_t>(numbers[1])};
  if (numbers[2] != fingerprint(query, place)) return refused();
  return place;
}

}  // namespace joulecast::history
