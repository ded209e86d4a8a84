#include "tests/study/exploration/map_file.h"
#include "text_input.h"

using namespace joulecast;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto map = exploration::parse_map(testing::as_text(data, size));
  testing::require(!map || exploration::validate(*map).has_value());
  return 0;
}
