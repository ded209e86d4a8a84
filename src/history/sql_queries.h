#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "base/error.h"
#include "history/sql.h"
#include "history/store.h"

// Parts of the queries, on a connection within a transaction. They throw SqlError.
namespace joulecast::history {

tl::unexpected<Error> no_mission(MissionKey key);
// Whether the store has this mission.
bool has_mission(Database& database, MissionKey key);

// Fault::invalid on `field` unless 1 <= limit <= greatest.
Result<void> check_limit(std::string_view field, std::int64_t limit, std::int64_t greatest);

// The last one of that robot and name before the time; 0: none.
MissionKey last_called(Database& database, std::string_view robot_id, std::string_view mission_id,
                       std::int64_t before_utime_us);
// 0 when there are no missions.
MissionKey greatest_key(Database& database);

tl::unexpected<Error> no_floor_plan(std::string_view map, std::string_view level);

Result<std::optional<Learned>> learned(Database& database, std::string_view robot_id, std::string_view topic);
Result<Proposal> proposal(Database& database, std::int64_t id);

}  // namespace joulecast::history
