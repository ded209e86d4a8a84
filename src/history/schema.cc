#include "history/schema.h"

#include <map>
#include <regex>
#include <string>
#include <vector>

#include "base/host_clock.h"
#include "base/json_writer.h"
#include "history/audit.h"
#include "history/sqlite.h"

namespace joulecast::history {

extern const std::string_view store_sql;  // schemas/store.sql, embedded at build

namespace {

constexpr std::int64_t store_version = 9;
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
    {2, R"sql(
ALTER TABLE model ADD COLUMN evidence_json TEXT CHECK (evidence_json IS NULL OR json_valid(evidence_json));
-- Diagnoses of the gap, as jobs and as results.
CREATE TABLE diagnosis (
  diagnosis_id INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
  robot_id TEXT NOT NULL REFERENCES robot (robot_id),
  created_utime_us INTEGER NOT NULL,
  started_utime_us INTEGER,
  finished_utime_us INTEGER,
  state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled', 'interrupted')),
  cause TEXT NOT NULL CHECK (cause IN ('request', 'watch')),
  request_json TEXT NOT NULL CHECK (json_valid(request_json)),
  model_version INTEGER,  -- the model that was diagnosed
  fitted_on TEXT NOT NULL CHECK (json_valid(fitted_on)),  -- [mission_key, ...]
  held_back TEXT NOT NULL CHECK (json_valid(held_back)),  -- [mission_key, ...]: left for a back-test
  result_json TEXT CHECK (result_json IS NULL OR json_valid(result_json)),
  model_json TEXT CHECK (model_json IS NULL OR json_valid(model_json)),  -- the robot file with the effects found; NULL: nothing to adopt
  error TEXT NOT NULL,
  FOREIGN KEY (robot_id, model_version) REFERENCES model (robot_id, version)
) STRICT;

CREATE INDEX diagnosis_by_robot ON diagnosis (robot_id, diagnosis_id);
CREATE INDEX diagnosis_by_state ON diagnosis (state) WHERE state IN ('queued', 'running');

CREATE TABLE diagnosis_report (
  diagnosis_id INTEGER NOT NULL PRIMARY KEY REFERENCES diagnosis (diagnosis_id) ON DELETE CASCADE,
  html TEXT NOT NULL
) STRICT;

-- Models that something suggests and nobody adopted yet.
CREATE TABLE proposal (
  proposal_id INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT,
  robot_id TEXT NOT NULL REFERENCES robot (robot_id),
  created_utime_us INTEGER NOT NULL,
  kind TEXT NOT NULL CHECK (kind <> ''),
  state TEXT NOT NULL CHECK (state IN ('open', 'adopted', 'dismissed', 'superseded')),
  note TEXT NOT NULL,
  base_version INTEGER,     -- the model that it changes
  adopted_version INTEGER,  -- what it became
  fitted_on TEXT NOT NULL CHECK (json_valid(fitted_on)),  -- [mission_key, ...]
  model_json TEXT NOT NULL CHECK (json_valid(model_json)),
  detail_json TEXT NOT NULL CHECK (json_valid(detail_json)),
  FOREIGN KEY (robot_id, base_version) REFERENCES model (robot_id, version),
  FOREIGN KEY (robot_id, adopted_version) REFERENCES model (robot_id, version)
) STRICT;

CREATE INDEX proposal_by_robot ON proposal (robot_id, proposal_id);
)sql"},
    {3,
     "ALTER TABLE mission ADD COLUMN findings_json TEXT CHECK (findings_json IS NULL OR "
     "json_valid(findings_json));"},
    {4, R"sql(
ALTER TABLE diagnosis ADD COLUMN summary_json TEXT CHECK (summary_json IS NULL OR json_valid(summary_json));
UPDATE diagnosis SET summary_json = json_object(
  'effects', (SELECT json_group_array(json_object('id', value ->> 'id', 'probability', value -> 'probability',
                                                  'share', value -> 'share'))
              FROM json_each(result_json, '$.effects')),
  'gap', result_json -> 'gap', 'shrinkage', result_json -> 'shrinkage', 'verdict', result_json -> 'verdict')
WHERE json_type(result_json) = 'object';
)sql"},
    {5, R"sql(
ALTER TABLE mission ADD COLUMN covariate_changes INTEGER NOT NULL DEFAULT 0;
ALTER TABLE mission ADD COLUMN covariates_json TEXT CHECK (covariates_json IS NULL OR json_valid(covariates_json));
CREATE TABLE covariate_chunk (
  chunk_key INTEGER NOT NULL PRIMARY KEY,
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  first_ordinal INTEGER NOT NULL,
  changes INTEGER NOT NULL CHECK (changes > 0),
  start_utime_us INTEGER NOT NULL,
  end_utime_us INTEGER NOT NULL,
  stored_utime_us INTEGER NOT NULL,
  sealed INTEGER NOT NULL CHECK (sealed IN (0, 1)),
  bytes INTEGER NOT NULL CHECK (bytes = length(body)),
  body BLOB NOT NULL,
  UNIQUE (mission_key, first_ordinal)
) STRICT;

CREATE INDEX covariate_chunk_by_age ON covariate_chunk (stored_utime_us, sealed, bytes);
CREATE INDEX covariate_chunk_tail ON covariate_chunk (mission_key, first_ordinal) WHERE sealed = 0;
)sql"},
    {6, R"sql(
CREATE TABLE audit (
  audit_id INTEGER NOT NULL PRIMARY KEY,  -- 1, 2, 3 ...
  utime_us INTEGER NOT NULL,
  actor TEXT NOT NULL,       -- name of a token; empty: nobody who is known
  address TEXT NOT NULL,     -- IP address of the client; empty: the daemon itself
  request_id TEXT NOT NULL,
  action TEXT NOT NULL CHECK (action <> ''),
  detail_json TEXT NOT NULL CHECK (json_valid(detail_json)),
  hash TEXT NOT NULL CHECK (length(hash) = 64)  -- over this entry and the hash before, see src/history/audit.h
) STRICT;

CREATE TRIGGER audit_keeps_entries BEFORE DELETE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit is only appended to'); END;
CREATE TRIGGER audit_keeps_content BEFORE UPDATE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit is only appended to'); END;
)sql"},
    {7, R"sql(CREATE TABLE request_answer (
  actor TEXT NOT NULL,  -- name of a token; empty: nobody who is known
  idempotency_key TEXT NOT NULL CHECK (idempotency_key <> ''),
  fingerprint TEXT NOT NULL,
  utime_us INTEGER NOT NULL,
  status INTEGER NOT NULL,    -- of HTTP
  location TEXT NOT NULL,  -- its Location header; empty: none
  body TEXT NOT NULL,
  PRIMARY KEY (actor, idempotency_key)
) STRICT;

CREATE INDEX request_answer_by_age ON request_answer (utime_us);
)sql"},
    {8, R"sql(
CREATE TABLE joulecast_store (
  one INTEGER NOT NULL PRIMARY KEY CHECK (one = 1),
  identity TEXT NOT NULL,
  writer TEXT NOT NULL,
  batch INTEGER NOT NULL
) STRICT;

INSERT INTO joulecast_store VALUES (1, lower(hex(randomblob(16))), '', 0);

CREATE TABLE taken_spool (
  hash TEXT NOT NULL PRIMARY KEY,  -- SHA-256 of the file
  utime_us INTEGER NOT NULL
) STRICT;
)sql"},
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

// What a schema consists of, by kind and name: of tables the columns, else the statement without blanks and
// comments.
std::map<std::string, std::string> objects_of(Database& database) {
  std::map<std::string, std::string> objects;
  Rows rows(database.statement(
      "SELECT type || ' ' || s.name, type = 'table', coalesce(CASE type WHEN 'table' THEN (SELECT "
      "group_concat(name) FROM (SELECT c.name FROM pragma_table_info(s.name) AS c ORDER BY c.name)) ELSE sql "
      "END, '') FROM sqlite_schema AS s WHERE s.name NOT LIKE 'sqlite_%'"));
  while (rows.next()) {
    const std::string name = rows.text();
    const bool table = rows.boolean();
    static const std::regex ignored("--[^\n]*|\\s+");
    objects[name] = table ? rows.text() : std::regex_replace(rows.text(), ignored, "");
  }
  return objects;
}

// Makes the triggers and indexes those of the schema. A change of them is the work of another program, and is
// recorded in the audit.
void restore_objects(Database& database, const Schema& schema) {
  std::vector<std::string> differences = schema_differences(database, schema);
  std::erase_if(differences, [](const std::string& difference) {
    return !difference.starts_with("trigger ") &&
           !(difference.starts_with("index ") && difference.ends_with(" is missing"));
  });
  if (differences.empty()) return;
  const auto names = [](Database& of, const char* type) {
    std::map<std::string, std::string> found;
    Rows rows(of.statement("SELECT name, sql FROM sqlite_schema WHERE sql IS NOT NULL AND type = ?"));
    rows.bind(type);
    while (rows.next()) {
      std::string name = rows.text();
      found[std::move(name)] = rows.text();
    }
    return found;
  };
  SqliteDatabase made(":memory:", OpenMode::read_write_create, 0);
  made.execute(std::string(schema.sql));
  for (const auto& [name, sql] : names(database, "trigger"))
    database.execute("DROP TRIGGER \"" + std::regex_replace(name, std::regex("\""), "\"\"") + "\"");
  for (const auto& [name, sql] : names(made, "trigger")) database.execute(sql);
  const auto indexes = names(database, "index");
  for (const auto& [name, sql] : names(made, "index"))
    if (!indexes.contains(name)) database.execute(sql);
  if (!database.has_table("audit")) return;
  JsonWriter detail;
  detail.begin_object().array("differences", differences).end_object();
  append_audit(database, {0, host_utime_us(), "", "", "", "schema_restored", detail.take(), ""});
}

}  // namespace

std::vector<std::string> schema_differences(Database& database, const Schema& schema) {
  SqliteDatabase made(":memory:", OpenMode::read_write_create, 0);
  made.execute(std::string(schema.sql));
  const auto expected = objects_of(made), found = objects_of(database);
  std::vector<std::string> differences;
  for (const auto& [name, content] : expected) {
    const auto same = found.find(name);
    if (same == found.end()) differences.push_back(name + " is missing");
    if (same != found.end() && same->second != content) differences.push_back(name + " was changed");
  }
  for (const auto& [name, content] : found)
    if (!expected.contains(name) && (name.starts_with("trigger ") || name.starts_with("view ")))
      differences.push_back(name + " was added");
  return differences;
}

const Schema& store_schema() {
  static const Schema schema{store_version, store_sql, store_migrations};
  return schema;
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
  } else if (version > schema.version) {
    return fail(Fault::conflict, "database",
                "schema version " + std::to_string(version) + " is newer than version " +
                    std::to_string(schema.version) + ", the newest that this program supports");
  } else if (version < schema.version) {
    if (auto migrated = migrate(database, schema, version); !migrated) return migrated;
    if (database.integer("SELECT count(*) FROM pragma_foreign_key_check") != 0)
      return fail(Fault::corrupt, "database", "a reference does not hold after migration");
  }
  restore_objects(database, schema);
  database.execute("PRAGMA user_version = " + std::to_string(schema.version));
  transaction.commit();
  return {};
}

}  // namespace joulecast::history
