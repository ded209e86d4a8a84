#include "battery/recording.h"
#include "text_input.h"

using namespace joulecast;

// The times of recordings rise, and all columns have the same length.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  (void)battery::parse_recordings(testing::as_text(data, size), "input");
  return 0;
}
