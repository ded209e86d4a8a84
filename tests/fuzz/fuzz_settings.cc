#include "server/settings.h"
#include "text_input.h"

using namespace joulecast;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Settings settings;
  (void)settings.read_file_text(testing::as_text(data, size), "input");
  testing::require(!settings.print().empty());
  return 0;
}
