#include "history/postgres_schema.h"

#include <string>
#include <string_view>

#include "history/mission_days.h"
#include "history/postgres_partitions.h"

namespace joulecast::history {

extern const std::string_view postgres_store_sql;     // schemas/store.postgresql.sql, embedded at build
extern const std::string_view postgres_by_robot_sql;  // schemas/store_by_robot.postgresql.sql
extern const std::string_view postgres_cluster_sql;   // schemas/cluster.postgresql.sql

namespace {

// From version 2 to 3.
constexpr const char* request_answers = R"(
CREATE TABLE request_answer (
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
)";

// From version 4 to 5.
constexpr const char* spools = R"(
ALTER TABLE joulecast_store ADD COLUMN identity TEXT NOT NULL DEFAULT gen_random_uuid()::text;
CREATE TABLE taken_spool (
  hash TEXT COLLATE "C" NOT NULL PRIMARY KEY,
  utime_us BIGINT NOT NULL
);
)";

// The tables that are recreated release their names and those of their indexes.
constexpr const char* set_aside = R"(
ALTER TABLE trace RENAME TO old_trace;
ALTER TABLE telemetry_chunk RENAME TO old_telemetry_chunk;
ALTER TABLE covariate_chunk RENAME TO old_covariate_chunk;
ALTER TABLE diagnosis_report RENAME TO old_diagnosis_report;
ALTER TABLE old_trace DROP CONSTRAINT trace_mission_key_fkey, DROP CONSTRAINT trace_pkey;
ALTER TABLE old_telemetry_chunk DROP CONSTRAINT telemetry_chunk_mission_key_fkey,
  DROP CONSTRAINT telemetry_chunk_pkey, DROP CONSTRAINT telemetry_chunk_mission_key_first_ordinal_key,
  DROP CONSTRAINT telemetry_chunk_check, DROP CONSTRAINT telemetry_chunk_samples_check, DROP CONSTRAINT telemetry_chunk_sealed_check,
  ALTER chunk_key DROP IDENTITY;
ALTER TABLE old_covariate_chunk DROP CONSTRAINT covariate_chunk_mission_key_fkey,
  DROP CONSTRAINT covariate_chunk_pkey, DROP CONSTRAINT covariate_chunk_mission_key_first_ordinal_key,
  DROP CONSTRAINT covariate_chunk_check, DROP CONSTRAINT covariate_chunk_changes_check, DROP CONSTRAINT covariate_chunk_sealed_check,
  ALTER chunk_key DROP IDENTITY;
DROP INDEX telemetry_chunk_by_age, telemetry_chunk_tail, covariate_chunk_by_age, covariate_chunk_tail;
ALTER TABLE old_diagnosis_report DROP CONSTRAINT diagnosis_report_diagnosis_id_fkey,
  DROP CONSTRAINT diagnosis_report_pkey;
ALTER TABLE cluster_job DROP CONSTRAINT IF EXISTS cluster_job_diagnosis_id_fkey;
ALTER TABLE mission DROP CONSTRAINT mission_pkey, ADD PRIMARY KEY (robot_id, mission_key);
CREATE INDEX mission_by_key ON mission (mission_key);
ALTER TABLE diagnosis DROP CONSTRAINT diagnosis_pkey, ADD PRIMARY KEY (robot_id, diagnosis_id);
DROP INDEX diagnosis_by_robot;
CREATE INDEX diagnosis_by_id ON diagnosis (diagnosis_id);
ALTER TABLE proposal DROP CONSTRAINT proposal_pkey, ADD PRIMARY KEY (robot_id, proposal_id);
DROP INDEX proposal_by_robot;
CREATE INDEX proposal_by_id ON proposal (proposal_id);
)";

constexpr const char* take_over = R"(
INSERT INTO trace (robot_id, mission_key, start_utime_us, covered_s, measured_power_min_w, measured_power_mean_w,
  measured_power_max_w, modelled_power_min_w, modelled_power_mean_w, modelled_power_max_w, speed_min_m_s,
  speed_mean_m_s, speed_max_m_s, state_of_charge, measured_j, modelled_j, x_m, y_m)
  SELECT robot_id, old_trace.* FROM old_trace JOIN mission USING (mission_key);
INSERT INTO telemetry_chunk (robot_id, chunk_key, mission_key, first_ordinal, samples, start_utime_us, end_utime_us,
  stored_utime_us, sealed, bytes, body)
  SELECT robot_id, old_telemetry_chunk.* FROM old_telemetry_chunk JOIN mission USING (mission_key);
INSERT INTO covariate_chunk (robot_id, chunk_key, mission_key, first_ordinal, changes, start_utime_us, end_utime_us,
  stored_utime_us, sealed, bytes, body)
  SELECT robot_id, old_covariate_chunk.* FROM old_covariate_chunk JOIN mission USING (mission_key);
INSERT INTO diagnosis_report SELECT robot_id, diagnosis_id, html FROM old_diagnosis_report JOIN diagnosis
  USING (diagnosis_id);
DROP TABLE old_trace, old_telemetry_chunk, old_covariate_chunk, old_diagnosis_report;
)";

void expect_rows_of(Database& database, const std::string& table, const std::string& time) {
  const std::string from = " FROM old_" + table;
  if (database.integer("SELECT count(*) FROM (SELECT 1" + from + " LIMIT 1) AS any_row") == 0) return;
  database.expect_rows(table, database.integer("SELECT min(" + time + ")" + from),
                       database.integer("SELECT max(" + time + ")" + from));
}

// From version 3 to 4: keys that begin with the robot, partitions, sums of days.
void key_by_robot(Database& database) {
  database.execute(set_aside);
  database.execute(std::string(postgres_by_robot_sql));
  expect_rows_of(database, "trace", "start_utime_us");
  expect_rows_of(database, "telemetry_chunk", "stored_utime_us");
  expect_rows_of(database, "covariate_chunk", "stored_utime_us");
  database.execute(take_over);
  add_up_all_days(database);
}

}  // namespace

Result<void> bring_to_postgres_schema(Database& database) {
  Transaction transaction(database, Database::Access::write);
  if (!database.has_table("joulecast_store")) {
    database.execute(std::string(postgres_store_sql));
    database.execute(std::string(postgres_by_robot_sql));
    database.execute(std::string(postgres_cluster_sql));
    database.execute("INSERT INTO joulecast_store (one, schema_version, writer, batch) VALUES (1, " +
                     std::to_string(postgres_schema_version) + ", '', 0)");
    transaction.commit();
    return {};
  }
  std::int64_t version = database.integer("SELECT schema_version FROM joulecast_store");
  if (version > postgres_schema_version)
    return fail(Fault::conflict, "database",
                "schema version " + std::to_string(version) + " is newer than version " +
                    std::to_string(postgres_schema_version) + ", the newest that this program supports");
  if (version == 1) {
    database.execute(std::string(postgres_cluster_sql));
    ++version;
  }
  if (version == 2) {
    database.execute(request_answers);
    ++version;
  }
  if (version == 3) {
    key_by_robot(database);
    ++version;
  }
  if (version == 4) {
    database.execute(spools);
    ++version;
  }
  if (version != postgres_schema_version)
    return fail(Fault::conflict, "database", "schema version " + std::to_string(version) + " is unknown");
  database.execute("UPDATE joulecast_store SET schema_version = " + std::to_string(version));
  transaction.commit();
  return {};
}

}  // namespace joulecast::history
