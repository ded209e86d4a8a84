#pragma once

#include "describe/table.h"
#include "history/records.h"

namespace joulecast::answers {

// One mission as lists and details show it, without its ledger.
const described::Table<history::Mission>& mission_table();

}  // namespace joulecast::answers
