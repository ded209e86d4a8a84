#include "base/text.h"
#include "fuzz.h"
#include "server/http/text.h"

using namespace joulecast;

// Segments and queries are valid UTF-8 without NUL.
JOULECAST_FUZZ_TARGET(target) {
  const auto target = http::parse_target(testing::as_text(data, size));
  if (!target) return;
  const auto sound = [](const std::string& text) {
    testing::require(is_utf8(text) && text.find('\0') == std::string::npos);
  };
  for (const std::string& segment : target->segments) sound(segment);
  for (const auto& [key, value] : target->query) {
    sound(key);
    sound(value);
  }
}
