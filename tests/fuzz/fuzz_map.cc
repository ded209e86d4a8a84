#include "fuzz.h"
#include "tests/study/exploration/map_file.h"

using namespace joulecast;

JOULECAST_FUZZ_TARGET(map) {
  const auto map = exploration::parse_map(testing::as_text(data, size));
  testing::require(!map || exploration::validate(*map).has_value());
}
