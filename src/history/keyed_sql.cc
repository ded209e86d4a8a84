#include "history/keyed_sql.h"

namespace joulecast::history {
namespace {

std::string replaced(std::string text, std::string_view mark, std::string_view by) {
  for (std::size_t at = 0; (at = text.find(mark, at)) != std::string::npos; at += by.size())
    text.replace(at, mark.size(), by);
  return text;
}

}  // namespace

KeyedSql::KeyedSql(const std::string& text)
    : plain_(replaced(replaced(replaced(text, "$of_mission", "mission_key = ?1"), "$key", "mission_key"),
                      "$values", "?")),
      by_robot_(
          replaced(replaced(replaced(text, "$of_mission",
                                     "(robot_id = (SELECT robot_id FROM mission WHERE mission_key = ?1) AND "
                                     "mission_key = ?1)"),
                            "$key", "robot_id, mission_key"),
                   "$values", "?, ?")) {}

void bind_key(Rows& rows, const Database& database, std::string_view robot_id, MissionKey key) {
  if (database.keyed_by_robot()) rows.bind(robot_id);
  rows.bind(key);
}

}  // namespace joulecast::history
