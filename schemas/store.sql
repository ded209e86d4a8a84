-- The history of a fleet, whose version is in user_version (src/history/schema.cc lists the changes). PostgreSQL has the same
-- tables with BIGINT, DOUBLE PRECISION, BYTEA and TEXT COLLATE "C", and the additions of store.postgresql.sql.
-- Names carry units; utime_us is microseconds since the Unix epoch. NULL in a REAL column: not measured.
-- Energy leaving the battery is positive. Sides: right, left.

-- One row. Its identity, and the last batch that was committed, by whom: a spool is taken in where it follows that.
CREATE TABLE joulecast_store (
  one INTEGER NOT NULL PRIMARY KEY CHECK (one = 1),
  identity TEXT NOT NULL,
  writer TEXT NOT NULL,
  batch INTEGER NOT NULL
) STRICT;

INSERT INTO joulecast_store VALUES (1, lower(hex(randomblob(16))), '', 0);

-- Spools that were taken in.
CREATE TABLE taken_spool (
  hash TEXT NOT NULL PRIMARY KEY,  -- SHA-256 of the file
  utime_us INTEGER NOT NULL
) STRICT;

CREATE TABLE robot (
  robot_id TEXT NOT NULL PRIMARY KEY CHECK (robot_id <> ''),
  created_utime_us INTEGER NOT NULL,
  active_version INTEGER,  -- NULL: nobody gave this robot's model yet
  FOREIGN KEY (robot_id, active_version) REFERENCES model (robot_id, version)
) STRICT;

CREATE TABLE model (
  robot_id TEXT NOT NULL REFERENCES robot (robot_id),
  version INTEGER NOT NULL CHECK (version >= 1),
  created_utime_us INTEGER NOT NULL,
  origin TEXT NOT NULL CHECK (origin IN ('file', 'http', 'calibration', 'diagnosis')),
  note TEXT NOT NULL,
  parent_version INTEGER,
  model_json TEXT NOT NULL CHECK (json_valid(model_json)),
  evidence_json TEXT CHECK (evidence_json IS NULL OR json_valid(evidence_json)),  -- why it was adopted: its back-test and what it came from
  PRIMARY KEY (robot_id, version),
  FOREIGN KEY (robot_id, parent_version) REFERENCES model (robot_id, version)
) STRICT;

CREATE TRIGGER model_is_immutable BEFORE UPDATE ON model
BEGIN
  SELECT RAISE(ABORT, 'a model version never changes');
END;

CREATE TABLE mission (
  mission_key INTEGER NOT NULL PRIMARY KEY CHECK (mission_key > 0),
  robot_id TEXT NOT NULL REFERENCES robot (robot_id),
  mission_id TEXT NOT NULL,
  start_utime_us INTEGER NOT NULL,
  end_utime_us INTEGER NOT NULL,
  state TEXT NOT NULL
    CHECK (state IN ('open', 'finished', 'aborted', 'unfinished', 'superseded', 'interrupted')),
  implicit INTEGER NOT NULL CHECK (implicit IN (0, 1)),
  incomplete INTEGER NOT NULL CHECK (incomplete IN (0, 1)),
  incomplete_reason TEXT NOT NULL,
  payload_kg REAL,
  note TEXT NOT NULL,
  model_version INTEGER,
  samples INTEGER NOT NULL,
  sample_faults TEXT NOT NULL CHECK (json_valid(sample_faults)),  -- {"reason": count}
  gap_count INTEGER NOT NULL,
  gap_s REAL,
  battery_j REAL,
  measured_j REAL,
  measured_s REAL,
  measured_motor_right_j REAL,
  measured_motor_left_j REAL,
  motor_measured_s REAL,
  modelled_j REAL,
  modelled_motor_right_j REAL,
  modelled_motor_left_j REAL,
  drawn_j REAL,
  returned_j REAL,
  charge_ah REAL,
  distance_m REAL,
  turned_rad REAL,
  duration_s REAL,
  ledger_accessories_j REAL,
  ledger_driver_j REAL,
  ledger_copper_j REAL,
  ledger_brush_j REAL,
  ledger_friction_internal_j REAL,
  ledger_friction_rolling_j REAL,
  ledger_friction_scrub_j REAL,
  ledger_friction_zone_j REAL,
  ledger_friction_slip_j REAL,
  ledger_drag_j REAL,
  ledger_kinetic_j REAL,
  ledger_potential_j REAL,
  ledger_braking_j REAL,
  ledger_recovered_j REAL,
  ledger_sensor_j REAL,
  ledger_unexplained_j REAL,
  telemetry_samples INTEGER NOT NULL DEFAULT 0,  -- raw samples ever stored; the next one's ordinal
  findings_json TEXT CHECK (findings_json IS NULL OR json_valid(findings_json)),  -- of payload and friction
  covariate_changes INTEGER NOT NULL DEFAULT 0,  -- changes of covariates ever stored; the next one's ordinal
  covariates_json TEXT CHECK (covariates_json IS NULL OR json_valid(covariates_json)),  -- [[name, mean, min, max, known_s, counted_utime_us, value, value_utime_us], ...]
  UNIQUE (robot_id, mission_id, start_utime_us),
  FOREIGN KEY (robot_id, model_version) REFERENCES model (robot_id, version)
) STRICT;

CREATE INDEX mission_by_start ON mission (start_utime_us, mission_key);
CREATE INDEX mission_by_robot ON mission (robot_id, start_utime_us, mission_key);
CREATE INDEX mission_by_model ON mission (robot_id, model_version);
CREATE INDEX mission_open ON mission (start_utime_us) WHERE state = 'open';

CREATE TABLE trace (
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  start_utime_us INTEGER NOT NULL,
  covered_s REAL,
  measured_power_min_w REAL,
  measured_power_mean_w REAL,
  measured_power_max_w REAL,
  modelled_power_min_w REAL,
  modelled_power_mean_w REAL,
  modelled_power_max_w REAL,
  speed_min_m_s REAL,
  speed_mean_m_s REAL,
  speed_max_m_s REAL,
  state_of_charge REAL,
  measured_j REAL,
  modelled_j REAL,
  x_m REAL,
  y_m REAL,
  PRIMARY KEY (mission_key, start_utime_us)
) STRICT, WITHOUT ROWID;

-- Raw samples in order of arrival. Small chunks come each second; they are merged into sealed ones as they add up.
CREATE TABLE telemetry_chunk (
  chunk_key INTEGER NOT NULL PRIMARY KEY,
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  first_ordinal INTEGER NOT NULL,
  samples INTEGER NOT NULL CHECK (samples > 0),
  start_utime_us INTEGER NOT NULL,  -- least of its samples
  end_utime_us INTEGER NOT NULL,    -- greatest of its samples
  stored_utime_us INTEGER NOT NULL,  -- the daemon's clock
  sealed INTEGER NOT NULL CHECK (sealed IN (0, 1)),
  bytes INTEGER NOT NULL CHECK (bytes = length(body)),
  body BLOB NOT NULL,  -- src/history/chunk_codec.h
  UNIQUE (mission_key, first_ordinal)
) STRICT;

CREATE INDEX telemetry_chunk_by_age ON telemetry_chunk (stored_utime_us, sealed, bytes);
CREATE INDEX telemetry_chunk_tail ON telemetry_chunk (mission_key, first_ordinal) WHERE sealed = 0;

-- What changed of a mission's covariates, in the same way.
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
  body BLOB NOT NULL,  -- src/history/chunk_codec.h
  UNIQUE (mission_key, first_ordinal)
) STRICT;

CREATE INDEX covariate_chunk_by_age ON covariate_chunk (stored_utime_us, sealed, bytes);
CREATE INDEX covariate_chunk_tail ON covariate_chunk (mission_key, first_ordinal) WHERE sealed = 0;

CREATE TABLE event (
  event_id INTEGER NOT NULL PRIMARY KEY,
  utime_us INTEGER NOT NULL,
  robot_id TEXT,  -- NULL: concerns no single robot; not a reference, for unknown robots have events too
  kind TEXT NOT NULL CHECK (kind <> ''),
  detail_json TEXT NOT NULL CHECK (json_valid(detail_json))
) STRICT;

CREATE INDEX event_by_robot ON event (robot_id, event_id);

CREATE TABLE energy_state (
  robot_id TEXT NOT NULL PRIMARY KEY REFERENCES robot (robot_id),
  utime_us INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  state_of_charge REAL,
  winding_temperature_right_c REAL,
  winding_temperature_left_c REAL
) STRICT;

-- What the service has learned of a robot by watching it, and would lose with a restart: one document a topic,
-- replaced as it grows.
CREATE TABLE learned (
  robot_id TEXT NOT NULL REFERENCES robot (robot_id),
  topic TEXT NOT NULL CHECK (topic <> ''),
  utime_us INTEGER NOT NULL,
  body_json TEXT NOT NULL CHECK (json_valid(body_json)),
  PRIMARY KEY (robot_id, topic)
) STRICT;

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
  summary_json TEXT CHECK (summary_json IS NULL OR json_valid(summary_json)),  -- what lists show of the result
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

-- Who changed what, and who was refused; each entry's hash covers the one before.
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

-- Answers of requests with an Idempotency-Key, for when they are repeated.
CREATE TABLE request_answer (
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

-- Plans of the floors on which the robots drive.
CREATE TABLE floor_plan (
  map TEXT NOT NULL CHECK (map <> ''),
  level TEXT NOT NULL CHECK (level <> ''),
  utime_us INTEGER NOT NULL,  -- of the upload
  resolution_m REAL NOT NULL CHECK (resolution_m > 0),  -- side of a pixel
  origin_x_m REAL NOT NULL,  -- of the image's lower left corner
  origin_y_m REAL NOT NULL,
  origin_yaw_rad REAL NOT NULL,
  chargers_json TEXT NOT NULL CHECK (json_valid(chargers_json)),  -- [[x_m, y_m], ...]
  media_type TEXT NOT NULL CHECK (media_type IN ('image/png', 'image/svg+xml')),
  image BLOB NOT NULL CHECK (length(image) > 0),
  PRIMARY KEY (map, level)
) STRICT;
