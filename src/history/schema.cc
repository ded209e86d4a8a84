#include "history/schema.h"

#include <string>

namespace joulecast::history {

extern const std::string_view store_sql;  // schemas/store.sql, embedded at build

const Schema& store_schema() {
  static const Schema schema{9, store_sql, {}};
  return schema;
}

Result<void> check_older(const Schema& schema, std::int64_t version) {
  if (!schema.migrations.empty() && version >= schema.migrations.front().from) return {};
  return fail(Fault::conflict, "database",
              "store of a development version: copy it with the build that wrote it");
}

Result<void> migrate(Database& database, const Schema& schema, std::int64_t version) {
  if (version > schema.version)
    return fail(Fault::conflict, "database",
                "schema version " + std::to_string(version) + " is newer than version " +
                    std::to_string(schema.version) + ", the newest that this program supports");
  if (version == schema.version) return {};
  if (auto known = check_older(schema, version); !known) return known;
  for (const Migration& migration : schema.migrations)
    if (migration.from >= version) database.execute(std::string(migration.sql));
  return {};
}

Result<void> bring_to_schema(Database& database, const Schema& schema) {
  Transaction transaction(database, Database::Access::write);
  const std::int64_t version = database.integer("PRAGMA user_version");
  const std::int64_t application = database.integer("PRAGMA application_id");
  const bool empty = database.integer("SELECT count(*) FROM sqlite_schema") == 0;
  if (empty && version == 0 && application == 0) {
    database.execute(std::string(schema.sql));
    database.execute("PRAGMA application_id = " + std::to_string(store_application_id));
  } else if (application != store_application_id) {
    return fail(Fault::corrupt, "database", "the file is an SQLite database, but not a joulecast store");
  } else {
    if (auto migrated = migrate(database, schema, version); !migrated) return migrated;
    if (version < schema.version && database.integer("SELECT count(*) FROM pragma_foreign_key_check") != 0)
      return fail(Fault::corrupt, "database", "a reference does not hold after migration");
  }
  database.execute("PRAGMA user_version = " + std::to_string(schema.version));
  transaction.commit();
  return {};
}

}  // namespace joulecast::history
