#pragma once

#include "history/records.h"
#include "server/api/json_writer.h"
#include "signals/ledger.h"

namespace joulecast::api {

// {"battery_j", "measured_j", ...}: null where nothing was measured.
void write_accounts(JsonWriter& json, const signals::Accounts& accounts);

// {"battery_j", "terms_j": {...}, "sum_j", "closure_relative"}: `recovered` counts negative in the sum.
void write_ledger(JsonWriter& json, const signals::Accounts& accounts);

// One mission as lists and details show it, without its ledger.
void write_mission(JsonWriter& json, const history::Mission& mission);

}  // namespace joulecast::api
