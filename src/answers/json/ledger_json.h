#pragma once

#include "describe/table.h"
#include "signals/ledger.h"

namespace joulecast::answers {

// {"battery_j", "measured_j", ...}: null where unmeasured.
const described::Table<signals::Accounts>& accounts_table();

// {"accessories", ...}: energies by term.
const described::Table<signals::Ledger>& terms_table();

// {"battery_j", "terms_j": {...}, "sum_j", "closure_relative"}: `recovered` counts negative in the sum.
const described::Table<signals::Accounts>& ledger_table();

}  // namespace joulecast::answers
