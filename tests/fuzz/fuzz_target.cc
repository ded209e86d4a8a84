#include "base/utf8.h"
#include "server/http/uri.h"
#include "text_input.h"

using namespace joulecast;

// Segments and queries are valid UTF-8 without NUL.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto target = http::parse_target(testing::as_text(data, size));
  if (!target) return 0;
  const auto sound = [](const std::string& text) {
    testing::require(is_utf8(text) && text.find('\0') == std::string::npos);
  };
  for (const std::string& segment : target->segments) sound(segment);
  for (const auto& [key, value] : target->query) {
    sound(key);
    sound(value);
  }
  return 0;
}
