#pragma once

#include "describe/table.h"
#include "drift/marks.h"
#include "energy/back_test.h"
#include "history/records.h"
#include "signals/ledger.h"

namespace joulecast::answers {

// {"battery_j", "measured_j", ...}: null where unmeasured.
const described::Table<signals::Accounts>& accounts_table();

// {"accessories", ...}: energies by term.
const described::Table<signals::Ledger>& terms_table();

// {"battery_j", "terms_j": {...}, "sum_j", "closure_relative"}: `recovered` counts negative in the sum.
const described::Table<signals::Accounts>& ledger_table();

// One mission as lists and details show it, without its ledger.
const described::Table<history::Mission>& mission_table();

// A change of a robot, the same in its gap history and its autonomy.
const described::Table<drift::Mark>& mark_table();

// The figures of a back-test; null where one is missing.
const described::Table<energy::BackTest>& back_test_table();

}  // namespace joulecast::answers
