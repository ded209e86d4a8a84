#pragma once

#include "tests/support/robots.h"

namespace joulecast::testing {

using samples::nomad;

}  // namespace joulecast::testing
