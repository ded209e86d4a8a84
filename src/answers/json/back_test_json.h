#pragma once

#include "describe/table.h"
#include "energy/back_test.h"

namespace joulecast::answers {

// The figures of a back-test; null where one is missing.
const described::Table<energy::BackTest>& back_test_table();

}  // namespace joulecast::answers
