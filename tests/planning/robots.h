#pragma once

#include "tests/support/robots.h"

namespace joulecast::planning::test {

using namespace joulecast::samples;

}  // namespace joulecast::planning::test
