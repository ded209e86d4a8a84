#include "access/robot_keys.h"
#include "access/token.h"
#include "text_input.h"

using namespace joulecast;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = testing::as_text(data, size);
  if (const auto keys = access::parse_robot_keys(text)) {
    const auto again = access::parse_robot_keys(access::to_json_text(*keys));
    testing::require(again && *again == *keys);
  }
  if (const auto tokens = access::parse_tokens(text))
    testing::require(access::parse_tokens(access::to_json_text(*tokens)).has_value());
  return 0;
}
