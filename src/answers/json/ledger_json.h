#pragma once

#include "base/json_writer.h"
#include "signals/ledger.h"

namespace joulecast::answers {

// {"battery_j", "measured_j", ...}: null where unmeasured.
void write_accounts(JsonWriter& json, const signals::Accounts& accounts);

// {"battery_j", "terms_j": {...}, "sum_j", "closure_relative"}: `recovered` counts negative in the sum.
void write_ledger(JsonWriter& json, const signals::Accounts& accounts);

}  // namespace joulecast::answers
