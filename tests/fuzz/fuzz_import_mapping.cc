#include "fuzz.h"
#include "telemetry/csv_import.h"

using namespace joulecast;

JOULECAST_FUZZ_TARGET(import_mapping) {
  const auto mapping = telemetry::ImportMapping::parse(testing::as_text(data, size));
  if (!mapping) testing::require(!mapping.error().message.empty());
}
