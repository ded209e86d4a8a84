#include "history/schema.h"

#include <string>

namespace joulecast::history {

extern const std::string_view store_sql;  // schemas/store.sql, embedded at build

namespace {

constexpr std::int64_t store_version = 2;
constexpr Migration store_migrations[] = {
    {1, R"(
CREATE TABLE learned (
  robot_id TEXT NOT NULL REFERENCES robot (robot_id),
  topic TEXT NOT NULL CHECK (topic <> ''),
  utime_us INTEGER NOT NULL,
  body_json TEXT NOT NULL CHECK (json_valid(body_json)),
  PRIMARY KEY (robot_id, topic)
) STRICT;
)"},
};

Result<void> migrate(Database& database, const Schema& schema, std::int64_t version) {
  for (const Migration& migration : schema.migrations) {
    if (migration.from < version) continue;
    if (migration.from != version) break;
    database.execute(std::string(migration.sql));
    ++version;
  }
  if (version == schema.version) return {};
  return fail(Fault::conflict, "database",
              "schema version " + std::to_string(version) + " is too old to be brought to version " +
                  std::to_string(schema.version));
}

}  // namespace

const Schema& store_schema() {
  static const Schema schema{store_version, store_sql, store_migrations};
  return schema;
}

Result<void> bring_to_schema(Database& database, const Schema& schema) {
  Transaction transaction(database, Transaction::Kind::write);
  const std::int64_t version = database.integer("PRAGMA user_version");
  const std::int64_t application = database.integer("PRAGMA application_id");
  const bool empty = database.integer("SELECT count(*) FROM sqlite_schema") == 0;
  if (empty && version == 0 && application == 0) {
    database.execute(std::string(schema.sql));
    database.execute("PRAGMA application_id = " + std::to_string(store_application_id));
  } else if (application != store_application_id) {
    return fail(Fault::corrupt, "database", "the file is an SQLite database, but not a joulecast store");
  } else if (version > schema.version) {
    return fail(Fault::conflict, "database",
                "schema version " + std::to_string(version) + " is newer than version " +
                    std::to_string(schema.version) + ", the newest that this program knows");
  } else if (version < schema.version) {
    if (auto migrated = migrate(database, schema, version); !migrated) return migrated;
    if (database.integer("SELECT count(*) FROM pragma_foreign_key_check") != 0)
      return fail(Fault::corrupt, "database", "a reference does not hold after migration");
  }
  database.execute("PRAGMA user_version = " + std::to_string(schema.version));
  transaction.commit();
  return {};
}

}  // namespace joulecast::history
