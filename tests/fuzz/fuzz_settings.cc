#include "fuzz.h"
#include "server/settings.h"

using namespace joulecast;

JOULECAST_FUZZ_TARGET(settings) {
  Settings settings;
  (void)settings.read_file_text(testing::as_text(data, size), "input");
  testing::require(!settings.print().empty());
}
