#pragma once

#include <string>
#include <string_view>

#include "history/records.h"
#include "history/sql.h"

namespace joulecast::history {

// A statement on rows of missions, for tables with keys that begin with the robot and for those of store.sql.
// In its text
//   $of_mission  is the condition that a row belongs to the mission with the key in parameter ?1,
//   $key         are the columns of a mission's key, and $values their parameters, for bind_key().
class KeyedSql {
 public:
  explicit KeyedSql(const std::string& text);

  Statement& in(Database& database) const {
    return database.statement(database.keyed_by_robot() ? by_robot_ : plain_);
  }

 private:
  std::string plain_, by_robot_;
};

// Binds the parameters of $values.
void bind_key(Rows& rows, const Database& database, std::string_view robot_id, MissionKey key);

}  // namespace joulecast::history
