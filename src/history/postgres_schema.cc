#include "history/postgres_schema.h"

#include <array>
#include <span>
#include <string>
#include <string_view>

#include "history/schema.h"

namespace joulecast::history {

extern const std::string_view postgres_store_sql;    // schemas/store.postgresql.sql, embedded at build
extern const std::string_view postgres_cluster_sql;  // schemas/cluster.postgresql.sql

namespace {

std::span<const Migration> postgres_migrations() {
  static const std::array migrations{Migration{1, postgres_cluster_sql},
                                     Migration{2, R"sql(CREATE TABLE request_answer (
  actor TEXT COLLATE "C" NOT NULL,  -- name of a token; empty: nobody who is known
  idempotency_key TEXT COLLATE "C" NOT NULL CHECK (idempotency_key <> ''),
  fingerprint TEXT NOT NULL,
  utime_us BIGINT NOT NULL,
  status BIGINT NOT NULL,    -- of HTTP
  location TEXT NOT NULL,  -- its Location header; empty: none
  body TEXT NOT NULL,
  PRIMARY KEY (actor, idempotency_key)
);

CREATE INDEX request_answer_by_age ON request_answer (utime_us);
)sql"}};
  return migrations;
}

}  // namespace

Result<void> bring_to_postgres_schema(Database& database) {
  Transaction transaction(database, Database::Access::write);
  if (!database.has_table("joulecast_store")) {
    database.execute(std::string(postgres_store_sql));
    database.execute(std::string(postgres_cluster_sql));
    database.execute("INSERT INTO joulecast_store VALUES (1, " + std::to_string(postgres_schema_version) +
                     ", '', 0)");
    transaction.commit();
    return {};
  }
  std::int64_t version = database.integer("SELECT schema_version FROM joulecast_store");
  if (version > postgres_schema_version)
    return fail(Fault::conflict, "database",
                "schema version " + std::to_string(version) + " is newer than version " +
                    std::to_string(postgres_schema_version) + ", the newest that this program knows");
  for (const Migration& migration : postgres_migrations()) {
    if (migration.from != version) continue;
    database.execute(std::string(migration.sql));
    ++version;
  }
  if (version != postgres_schema_version)
    return fail(Fault::conflict, "database", "schema version " + std::to_string(version) + " is unknown");
  database.execute("UPDATE joulecast_store SET schema_version = " + std::to_string(version));
  transaction.commit();
  return {};
}

}  // namespace joulecast::history
