#include "access/robot_keys.h"
#include "access/token.h"
#include "fuzz.h"

using namespace joulecast;

JOULECAST_FUZZ_TARGET(tokens) {
  const std::string_view text = testing::as_text(data, size);
  if (const auto keys = access::parse_robot_keys(text)) {
    const auto again = access::parse_robot_keys(access::to_json_text(*keys));
    testing::require(again && *again == *keys);
  }
  if (const auto tokens = access::parse_tokens(text))
    testing::require(access::parse_tokens(access::to_json_text(*tokens)).has_value());
}
