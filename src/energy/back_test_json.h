#pragma once

#include <nlohmann/json_fwd.hpp>

#include "energy/back_test.h"

namespace joulecast::energy {

// The figures of a back-test (schemas/back-test.schema.json); null where a figure is missing.
nlohmann::json back_test_to_json(const BackTest& test);

}  // namespace joulecast::energy
