#pragma once

#include "base/json_writer.h"
#include "history/records.h"

namespace joulecast::answers {

// One mission as lists and details show it, without its ledger.
void write_mission(JsonWriter& json, const history::Mission& mission);

}  // namespace joulecast::answers
