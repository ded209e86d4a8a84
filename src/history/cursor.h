#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/error.h"

// Page cursors: opaque to callers, bound to the query they came from.
namespace joulecast::history {

// A place in an ordered result: two numbers with a meaning that depends on the query.
using CursorPlace = std::array<std::int64_t, 2>;

// `query` is any text that distinguishes queries; its fingerprint goes into the cursor. The result is
// URL-safe.
std::string encode_cursor(std::string_view query, CursorPlace place);

// Fault::invalid on field "cursor" for a malformed cursor or one of another query.
Result<CursorPlace> decode_cursor(std::string_view query, std::string_view cursor);

}  // namespace joulecast::history
