#include "telemetry/csv_import.h"
#include "text_input.h"

using namespace joulecast;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto mapping = telemetry::ImportMapping::parse(testing::as_text(data, size));
  if (!mapping) testing::require(!mapping.error().message.empty());
  return 0;
}
