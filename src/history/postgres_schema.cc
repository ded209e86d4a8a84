#include "history/postgres_schema.h"

#include <string>
#include <string_view>

#include "base/try.h"

namespace joulecast::history {

extern const std::string_view postgres_store_sql;     // schemas/store.postgresql.sql, embedded at build
extern const std::string_view postgres_by_robot_sql;  // schemas/store_by_robot.postgresql.sql
extern const std::string_view postgres_cluster_sql;   // schemas/cluster.postgresql.sql

const Schema& postgres_schema() {
  static const std::string sql =
      std::string(postgres_store_sql).append(postgres_by_robot_sql).append(postgres_cluster_sql);
  static const Schema schema{6, sql, {}};
  return schema;
}

Result<void> bring_to_postgres_schema(Database& database, const Schema& schema) {
  Transaction transaction(database, Database::Access::write);
  const std::string version = std::to_string(schema.version);
  if (!database.has_table("joulecast_store")) {
    database.execute(std::string(schema.sql));
    database.execute("INSERT INTO joulecast_store (one, schema_version, writer, batch) VALUES (1, " +
                     version + ", '', 0)");
  } else {
    const std::int64_t present = database.integer("SELECT schema_version FROM joulecast_store");
    TRY(migrate(database, schema, present));
    database.execute("UPDATE joulecast_store SET schema_version = " + version);
  }
  transaction.commit();
  return {};
}

}  // namespace joulecast::history
