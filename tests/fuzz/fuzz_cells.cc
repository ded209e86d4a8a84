#include "battery/recording.h"
#include "fuzz.h"

using namespace joulecast;

// The times of recordings rise, and all columns have the same length.
JOULECAST_FUZZ_TARGET(cells) {
  (void)battery::parse_recordings(testing::as_text(data, size), "input");
}
