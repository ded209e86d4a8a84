#pragma once

#include "describe/table.h"
#include "drift/marks.h"
#include "history/records.h"

namespace joulecast::answers {

// One mission as lists and details show it, without its ledger.
const described::Table<history::Mission>& mission_table();

// A change of a robot, the same in its gap history and its autonomy.
const described::Table<drift::Mark>& mark_table();

}  // namespace joulecast::answers
