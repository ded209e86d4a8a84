-- The history of a fleet in PostgreSQL, schema version 2 (src/history/postgres_schema.cc lists the migrations to it). The
-- tables and columns are those of store.sql, where what they hold is described.
-- Names carry units; utime_us is microseconds since the Unix epoch. NULL in a DOUBLE PRECISION column: not measured.
-- Names compare by their bytes (COLLATE "C"), as SQLite compares them. JSON is kept as text, byte for byte.

-- One row. Whoever writes says who it is and counts its batches, so that a batch whose COMMIT was cut off is known again.
CREATE TABLE joulecast_store (
  one BIGINT NOT NULL PRIMARY KEY CHECK (one = 1),
  schema_version BIGINT NOT NULL,
  writer TEXT NOT NULL,
  batch BIGINT NOT NULL
);

CREATE TABLE robot (
  robot_id TEXT COLLATE "C" NOT NULL PRIMARY KEY CHECK (robot_id <> ''),
  created_utime_us BIGINT NOT NULL,
  active_version BIGINT  -- NULL: nobody gave this robot's model yet
);

CREATE TABLE model (
  robot_id TEXT COLLATE "C" NOT NULL REFERENCES robot (robot_id),
  version BIGINT NOT NULL CHECK (version >= 1),
  created_utime_us BIGINT NOT NULL,
  origin TEXT NOT NULL CHECK (origin IN ('file', 'http', 'calibration', 'diagnosis')),
  note TEXT NOT NULL,
  parent_version BIGINT,
  model_json TEXT NOT NULL CHECK (model_json::json IS NOT NULL),
  evidence_json TEXT CHECK (evidence_json IS NULL OR evidence_json::json IS NOT NULL),  -- why it was adopted: its back-test and what it came from
  PRIMARY KEY (robot_id, version),
  FOREIGN KEY (robot_id, parent_version) REFERENCES model (robot_id, version)
);

ALTER TABLE robot ADD FOREIGN KEY (robot_id, active_version) REFERENCES model (robot_id, version);

CREATE FUNCTION model_is_immutable() RETURNS trigger LANGUAGE plpgsql AS
$$BEGIN RAISE EXCEPTION 'a model version never changes'; END$$;
CREATE TRIGGER model_is_immutable BEFORE UPDATE ON model EXECUTE FUNCTION model_is_immutable();

CREATE TABLE mission (
  mission_key BIGINT NOT NULL PRIMARY KEY CHECK (mission_key > 0),
  robot_id TEXT COLLATE "C" NOT NULL REFERENCES robot (robot_id),
  mission_id TEXT COLLATE "C" NOT NULL,
  start_utime_us BIGINT NOT NULL,
  end_utime_us BIGINT NOT NULL,
  state TEXT NOT NULL
    CHECK (state IN ('open', 'finished', 'aborted', 'unfinished', 'superseded', 'interrupted')),
  implicit BIGINT NOT NULL CHECK (implicit IN (0, 1)),
  incomplete BIGINT NOT NULL CHECK (incomplete IN (0, 1)),
  incomplete_reason TEXT NOT NULL,
  payload_kg DOUBLE PRECISION,
  note TEXT NOT NULL,
  model_version BIGINT,
  samples BIGINT NOT NULL,
  sample_faults TEXT NOT NULL CHECK (sample_faults::json IS NOT NULL),  -- {"reason": count}
  gap_count BIGINT NOT NULL,
  gap_s DOUBLE PRECISION,
  battery_j DOUBLE PRECISION,
  measured_j DOUBLE PRECISION,
  measured_s DOUBLE PRECISION,
  measured_motor_right_j DOUBLE PRECISION,
  measured_motor_left_j DOUBLE PRECISION,
  motor_measured_s DOUBLE PRECISION,
  modelled_j DOUBLE PRECISION,
  modelled_motor_right_j DOUBLE PRECISION,
  modelled_motor_left_j DOUBLE PRECISION,
  drawn_j DOUBLE PRECISION,
  returned_j DOUBLE PRECISION,
  charge_ah DOUBLE PRECISION,
  distance_m DOUBLE PRECISION,
  turned_rad DOUBLE PRECISION,
  duration_s DOUBLE PRECISION,
  ledger_accessories_j DOUBLE PRECISION,
  ledger_driver_j DOUBLE PRECISION,
  ledger_copper_j DOUBLE PRECISION,
  ledger_brush_j DOUBLE PRECISION,
  ledger_friction_internal_j DOUBLE PRECISION,
  ledger_friction_rolling_j DOUBLE PRECISION,
  ledger_friction_scrub_j DOUBLE PRECISION,
  ledger_friction_zone_j DOUBLE PRECISION,
  ledger_friction_slip_j DOUBLE PRECISION,
  ledger_drag_j DOUBLE PRECISION,
  ledger_kinetic_j DOUBLE PRECISION,
  ledger_potential_j DOUBLE PRECISION,
  ledger_braking_j DOUBLE PRECISION,
  ledger_recovered_j DOUBLE PRECISION,
  ledger_sensor_j DOUBLE PRECISION,
  ledger_unexplained_j DOUBLE PRECISION,
  telemetry_samples BIGINT NOT NULL DEFAULT 0,  -- raw samples ever stored; the next one's ordinal
  findings_json TEXT CHECK (findings_json IS NULL OR findings_json::json IS NOT NULL),  -- of payload and friction
  covariate_changes BIGINT NOT NULL DEFAULT 0,  -- changes of covariates ever stored; the next one's ordinal
  covariates_json TEXT CHECK (covariates_json IS NULL OR covariates_json::json IS NOT NULL),  -- [[name, mean, min, max, known_s, counted_utime_us, value, value_utime_us], ...]
  UNIQUE (robot_id, mission_id, start_utime_us),
  FOREIGN KEY (robot_id, model_version) REFERENCES model (robot_id, version)
) WITH (fillfactor = 70);  -- open missions are updated every second: in their own page

CREATE INDEX mission_by_start ON mission (start_utime_us, mission_key);
CREATE INDEX mission_by_robot ON mission (robot_id, start_utime_us, mission_key);
CREATE INDEX mission_by_model ON mission (robot_id, model_version);
CREATE INDEX mission_open ON mission (start_utime_us) WHERE state = 'open';

CREATE TABLE trace (
  mission_key BIGINT NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  start_utime_us BIGINT NOT NULL,
  covered_s DOUBLE PRECISION,
  measured_power_min_w DOUBLE PRECISION,
  measured_power_mean_w DOUBLE PRECISION,
  measured_power_max_w DOUBLE PRECISION,
  modelled_power_min_w DOUBLE PRECISION,
  modelled_power_mean_w DOUBLE PRECISION,
  modelled_power_max_w DOUBLE PRECISION,
  speed_min_m_s DOUBLE PRECISION,
  speed_mean_m_s DOUBLE PRECISION,
  speed_max_m_s DOUBLE PRECISION,
  state_of_charge DOUBLE PRECISION,
  measured_j DOUBLE PRECISION,
  modelled_j DOUBLE PRECISION,
  x_m DOUBLE PRECISION,
  y_m DOUBLE PRECISION,
  PRIMARY KEY (mission_key, start_utime_us)
);

-- Raw samples in order of arrival. Small chunks come each second; they are merged into sealed ones as they add up.
CREATE TABLE telemetry_chunk (
  chunk_key BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY,
  mission_key BIGINT NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  first_ordinal BIGINT NOT NULL,
  samples BIGINT NOT NULL CHECK (samples > 0),
  start_utime_us BIGINT NOT NULL,  -- least of its samples
  end_utime_us BIGINT NOT NULL,    -- greatest of its samples
  stored_utime_us BIGINT NOT NULL,  -- the daemon's clock
  sealed BIGINT NOT NULL CHECK (sealed IN (0, 1)),
  bytes BIGINT NOT NULL CHECK (bytes = length(body)),
  body BYTEA NOT NULL,  -- src/history/telemetry_chunk.h
  UNIQUE (mission_key, first_ordinal)
);

ALTER TABLE telemetry_chunk ALTER body SET STORAGE EXTERNAL;  -- compressed already
CREATE INDEX telemetry_chunk_by_age ON telemetry_chunk (stored_utime_us, sealed, bytes);
CREATE INDEX telemetry_chunk_tail ON telemetry_chunk (mission_key, first_ordinal) WHERE sealed = 0;

-- What changed of a mission's covariates, in the same way.
CREATE TABLE covariate_chunk (
  chunk_key BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY,
  mission_key BIGINT NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  first_ordinal BIGINT NOT NULL,
  changes BIGINT NOT NULL CHECK (changes > 0),
  start_utime_us BIGINT NOT NULL,
  end_utime_us BIGINT NOT NULL,
  stored_utime_us BIGINT NOT NULL,
  sealed BIGINT NOT NULL CHECK (sealed IN (0, 1)),
  bytes BIGINT NOT NULL CHECK (bytes = length(body)),
  body BYTEA NOT NULL,  -- src/history/covariate_chunk.h
  UNIQUE (mission_key, first_ordinal)
);

ALTER TABLE covariate_chunk ALTER body SET STORAGE EXTERNAL;  -- compressed already
CREATE INDEX covariate_chunk_by_age ON covariate_chunk (stored_utime_us, sealed, bytes);
CREATE INDEX covariate_chunk_tail ON covariate_chunk (mission_key, first_ordinal) WHERE sealed = 0;

CREATE TABLE event (
  event_id BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY,
  utime_us BIGINT NOT NULL,
  robot_id TEXT COLLATE "C",  -- NULL: concerns no single robot; not a reference, for unknown robots have events too
  kind TEXT NOT NULL CHECK (kind <> ''),
  detail_json TEXT NOT NULL CHECK (detail_json::json IS NOT NULL)
);

CREATE INDEX event_by_robot ON event (robot_id, event_id);

CREATE TABLE energy_state (
  robot_id TEXT COLLATE "C" NOT NULL PRIMARY KEY REFERENCES robot (robot_id),
  utime_us BIGINT NOT NULL,
  sequence BIGINT NOT NULL,
  state_of_charge DOUBLE PRECISION,
  winding_temperature_right_c DOUBLE PRECISION,
  winding_temperature_left_c DOUBLE PRECISION
);

-- What the service has learned of a robot by watching it, and would lose with a restart: one document a topic,
-- replaced as it grows.
CREATE TABLE learned (
  robot_id TEXT COLLATE "C" NOT NULL REFERENCES robot (robot_id),
  topic TEXT COLLATE "C" NOT NULL CHECK (topic <> ''),
  utime_us BIGINT NOT NULL,
  body_json TEXT NOT NULL CHECK (body_json::json IS NOT NULL),
  PRIMARY KEY (robot_id, topic)
);

-- Diagnoses of the gap, as jobs and as results.
CREATE TABLE diagnosis (
  diagnosis_id BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY,
  robot_id TEXT COLLATE "C" NOT NULL REFERENCES robot (robot_id),
  created_utime_us BIGINT NOT NULL,
  started_utime_us BIGINT,
  finished_utime_us BIGINT,
  state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled', 'interrupted')),
  cause TEXT NOT NULL CHECK (cause IN ('request', 'watch')),
  request_json TEXT NOT NULL CHECK (request_json::json IS NOT NULL),
  model_version BIGINT,  -- the model that was diagnosed
  fitted_on TEXT NOT NULL CHECK (fitted_on::json IS NOT NULL),  -- [mission_key, ...]
  held_back TEXT NOT NULL CHECK (held_back::json IS NOT NULL),  -- [mission_key, ...]: left for a back-test
  result_json TEXT CHECK (result_json IS NULL OR result_json::json IS NOT NULL),
  model_json TEXT CHECK (model_json IS NULL OR model_json::json IS NOT NULL),  -- the robot file with the effects found; NULL: nothing to adopt
  error TEXT NOT NULL,
  summary_json TEXT CHECK (summary_json IS NULL OR summary_json::json IS NOT NULL),  -- what lists show of the result
  FOREIGN KEY (robot_id, model_version) REFERENCES model (robot_id, version)
);

CREATE INDEX diagnosis_by_robot ON diagnosis (robot_id, diagnosis_id);
CREATE INDEX diagnosis_by_state ON diagnosis (state) WHERE state IN ('queued', 'running');

CREATE TABLE diagnosis_report (
  diagnosis_id BIGINT NOT NULL PRIMARY KEY REFERENCES diagnosis (diagnosis_id) ON DELETE CASCADE,
  html TEXT NOT NULL
);

-- Models that something suggests and nobody adopted yet.
CREATE TABLE proposal (
  proposal_id BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY,
  robot_id TEXT COLLATE "C" NOT NULL REFERENCES robot (robot_id),
  created_utime_us BIGINT NOT NULL,
  kind TEXT NOT NULL CHECK (kind <> ''),
  state TEXT NOT NULL CHECK (state IN ('open', 'adopted', 'dismissed', 'superseded')),
  note TEXT NOT NULL,
  base_version BIGINT,     -- the model that it changes
  adopted_version BIGINT,  -- what it became
  fitted_on TEXT NOT NULL CHECK (fitted_on::json IS NOT NULL),  -- [mission_key, ...]
  model_json TEXT NOT NULL CHECK (model_json::json IS NOT NULL),
  detail_json TEXT NOT NULL CHECK (detail_json::json IS NOT NULL),
  FOREIGN KEY (robot_id, base_version) REFERENCES model (robot_id, version),
  FOREIGN KEY (robot_id, adopted_version) REFERENCES model (robot_id, version)
);

CREATE INDEX proposal_by_robot ON proposal (robot_id, proposal_id);

-- Who changed what, and who was refused; each entry's hash covers the one before.
CREATE TABLE audit (
  audit_id BIGINT NOT NULL PRIMARY KEY,  -- 1, 2, 3 ...
  utime_us BIGINT NOT NULL,
  actor TEXT NOT NULL,       -- name of a token; empty: nobody who is known
  address TEXT NOT NULL,     -- IP address of the client; empty: the daemon itself
  request_id TEXT NOT NULL,
  action TEXT NOT NULL CHECK (action <> ''),
  detail_json TEXT NOT NULL CHECK (detail_json::json IS NOT NULL),
  hash TEXT NOT NULL CHECK (length(hash) = 64)  -- over this entry and the hash before, see src/history/audit.h
);

CREATE FUNCTION audit_is_appended_to() RETURNS trigger LANGUAGE plpgsql AS
$$BEGIN RAISE EXCEPTION 'the audit is only appended to'; END$$;
CREATE TRIGGER audit_keeps_entries BEFORE DELETE OR TRUNCATE ON audit EXECUTE FUNCTION audit_is_appended_to();
CREATE TRIGGER audit_keeps_content BEFORE UPDATE ON audit EXECUTE FUNCTION audit_is_appended_to();
-- What daemons that share a fleet (cluster.name) agree on in PostgreSQL, beside the history of store.postgresql.sql.
-- Times are the database's (clock_timestamp()): the daemons' clocks need not agree. None of it is history: a copy of the store
-- leaves it out, and after a restore the daemons make it anew.

-- The daemons of the cluster. One whose row is gone has lost its leases.
CREATE TABLE cluster_node (
  node TEXT COLLATE "C" NOT NULL PRIMARY KEY CHECK (node <> ''),
  cluster TEXT NOT NULL,
  incarnation BIGINT NOT NULL,  -- another one each time that the daemon joins
  writer TEXT NOT NULL,         -- application_name of its writing connection
  address TEXT NOT NULL,        -- where it answers
  version TEXT NOT NULL,
  joined TIMESTAMPTZ NOT NULL,
  expires TIMESTAMPTZ NOT NULL,  -- unless it is renewed
  server_started TIMESTAMPTZ NOT NULL,  -- of the server that it renews at, and its connection there
  backend_pid BIGINT NOT NULL,
  backend_started TIMESTAMPTZ NOT NULL
);

CREATE SEQUENCE cluster_incarnation;

-- Which daemon receives telemetry of which robot.
CREATE TABLE cluster_hears (
  node TEXT COLLATE "C" NOT NULL REFERENCES cluster_node (node) ON DELETE CASCADE,
  robot_id TEXT COLLATE "C" NOT NULL,
  since TIMESTAMPTZ NOT NULL,
  PRIMARY KEY (node, robot_id)
);

-- Which daemon keeps which robot. Whoever takes a robot raises the epoch; a commit under another epoch is dropped.
CREATE TABLE cluster_lease (
  robot_id TEXT COLLATE "C" NOT NULL PRIMARY KEY CHECK (robot_id <> ''),
  node TEXT COLLATE "C",        -- NULL: let go
  epoch BIGINT NOT NULL,
  taken TIMESTAMPTZ NOT NULL,
  takeovers BIGINT NOT NULL,    -- how often it was taken from a daemon that was gone
  utime_us BIGINT,              -- of the last sample that a mission has taken in, and its number; the robot's clock
  sequence BIGINT
) WITH (fillfactor = 50);  -- updated with every commit

-- Programs that write, with their batches, so that a batch whose COMMIT was cut off is known again.
CREATE TABLE cluster_writer (
  writer TEXT NOT NULL PRIMARY KEY,
  batch BIGINT NOT NULL,
  since TIMESTAMPTZ NOT NULL
);

-- Keys of missions are given out a thousand at a time.
CREATE SEQUENCE cluster_mission_keys INCREMENT 1000 MINVALUE 1;

-- Diagnoses that wait or run, and the writer of the daemon that has each.
CREATE TABLE cluster_job (
  diagnosis_id BIGINT NOT NULL PRIMARY KEY REFERENCES diagnosis (diagnosis_id) ON DELETE CASCADE,
  writer TEXT NOT NULL
);

-- The live state of each robot as its keeper last told it. Not logged: a crash of the server empties it, and the keepers
-- fill it again within a second.
CREATE UNLOGGED TABLE cluster_live (
  robot_id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
  node TEXT COLLATE "C" NOT NULL,
  epoch BIGINT NOT NULL,
  number BIGINT NOT NULL,  -- counts up under one epoch
  body BYTEA NOT NULL      -- src/ingest/snapshot_bytes.h
) WITH (fillfactor = 50);
