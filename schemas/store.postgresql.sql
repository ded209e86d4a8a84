-- The history of a fleet in PostgreSQL, schema version 6 (src/history/postgres_schema.cc lists the migrations), but for
-- what store_by_robot.postgresql.sql adds. The tables and columns are those of store.sql, where what they hold is described.
-- Every key of a table that is about robots begins with the robot, and every reference between two of them holds it, so that
-- they can be distributed by it. joulecast_store, taken_spool, event, audit, request_answer, floor_plan and the tables of the cluster are not.
-- Names carry units; utime_us is microseconds since the Unix epoch. NULL in a DOUBLE PRECISION column: not measured.
-- Names compare by their bytes (COLLATE "C"), as SQLite compares them. JSON is kept as text, byte for byte.

-- One row. Whoever writes says who it is and counts its batches, so that a batch whose COMMIT was cut off is known again.
CREATE TABLE joulecast_store (
  one BIGINT NOT NULL PRIMARY KEY CHECK (one = 1),
  schema_version BIGINT NOT NULL,
  writer TEXT NOT NULL,
  batch BIGINT NOT NULL,
  identity TEXT NOT NULL DEFAULT gen_random_uuid()::text
);

CREATE TABLE taken_spool (
  hash TEXT COLLATE "C" NOT NULL PRIMARY KEY,
  utime_us BIGINT NOT NULL
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
  mission_key BIGINT NOT NULL CHECK (mission_key > 0),
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
  PRIMARY KEY (robot_id, mission_key),
  UNIQUE (robot_id, mission_id, start_utime_us),
  FOREIGN KEY (robot_id, model_version) REFERENCES model (robot_id, version)
) WITH (fillfactor = 70);  -- open missions are updated every second: in their own page

CREATE INDEX mission_by_key ON mission (mission_key);
CREATE INDEX mission_by_start ON mission (start_utime_us, mission_key);
CREATE INDEX mission_by_robot ON mission (robot_id, start_utime_us, mission_key);
CREATE INDEX mission_by_model ON mission (robot_id, model_version);
CREATE INDEX mission_open ON mission (start_utime_us) WHERE state = 'open';

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
  diagnosis_id BIGINT GENERATED BY DEFAULT AS IDENTITY,
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
  PRIMARY KEY (robot_id, diagnosis_id),
  FOREIGN KEY (robot_id, model_version) REFERENCES model (robot_id, version)
);

CREATE INDEX diagnosis_by_id ON diagnosis (diagnosis_id);
CREATE INDEX diagnosis_by_state ON diagnosis (state) WHERE state IN ('queued', 'running');

-- Models that something suggests and nobody adopted yet.
CREATE TABLE proposal (
  proposal_id BIGINT GENERATED BY DEFAULT AS IDENTITY,
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
  PRIMARY KEY (robot_id, proposal_id),
  FOREIGN KEY (robot_id, base_version) REFERENCES model (robot_id, version),
  FOREIGN KEY (robot_id, adopted_version) REFERENCES model (robot_id, version)
);

CREATE INDEX proposal_by_id ON proposal (proposal_id);

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

-- Answers of requests with an Idempotency-Key, for when they are repeated.
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

-- Plans of the floors on which the robots drive.
CREATE TABLE floor_plan (
  map TEXT COLLATE "C" NOT NULL CHECK (map <> ''),
  level TEXT COLLATE "C" NOT NULL CHECK (level <> ''),
  utime_us BIGINT NOT NULL,  -- of the upload
  resolution_m DOUBLE PRECISION NOT NULL CHECK (resolution_m > 0),  -- side of a pixel
  origin_x_m DOUBLE PRECISION NOT NULL,  -- of the image's lower left corner
  origin_y_m DOUBLE PRECISION NOT NULL,
  origin_yaw_rad DOUBLE PRECISION NOT NULL,
  chargers_json TEXT NOT NULL CHECK (chargers_json::json IS NOT NULL),  -- [[x_m, y_m], ...]
  media_type TEXT NOT NULL CHECK (media_type IN ('image/png', 'image/svg+xml')),
  image BYTEA NOT NULL CHECK (length(image) > 0),
  PRIMARY KEY (map, level)
);

ALTER TABLE floor_plan ALTER image SET STORAGE EXTERNAL;  -- compressed already
