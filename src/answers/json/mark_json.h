#pragma once

#include "describe/table.h"
#include "drift/marks.h"

namespace joulecast::answers {

// A change of a robot, the same in its gap history and its autonomy.
const described::Table<drift::Mark>& mark_table();

}  // namespace joulecast::answers
