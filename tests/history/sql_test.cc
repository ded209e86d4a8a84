#include "history/sql.h"

#include <gtest/gtest.h>

#include "history/sqlite.h"

namespace joulecast::history {
namespace {

TEST(Sql, ReplacesRowsByKey) {
  EXPECT_EQ(insert_or_replace("t", "a, b", "c"),
            "INSERT INTO t (a, b, c) VALUES (?, ?, ?) ON CONFLICT (a, b) DO UPDATE SET c = excluded.c");
  SqliteDatabase database(":memory:", OpenMode::read_write_create, 0);
  database.execute("CREATE TABLE t (a INTEGER PRIMARY KEY, c INTEGER, d TEXT) STRICT");
  const std::string sql = insert_or_replace("t", "a", "c, d");
  for (const std::int64_t value : {1, 2})
    Rows(database.statement(sql)).bind(std::int64_t{7}).bind(value).bind("x" + std::to_string(value)).run();
  EXPECT_EQ(database.text("SELECT group_concat(a || ' ' || c || ' ' || d) FROM t"), "7 2 x2");
}

}  // namespace
}  // namespace joulecast::history
