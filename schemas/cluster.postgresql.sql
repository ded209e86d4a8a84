-- State that the daemons of a fleet (cluster.name) share in PostgreSQL, in addition to the history of store.postgresql.sql.
-- Times are the database's (clock_timestamp()): the daemons' clocks need not agree. None of it is history: a copy of the store
-- omits it, and the daemons recreate it after a restore.

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

-- Which daemon keeps which robot. A daemon that takes a robot raises the epoch; a commit under another epoch is dropped.
CREATE TABLE cluster_lease (
  robot_id TEXT COLLATE "C" NOT NULL PRIMARY KEY CHECK (robot_id <> ''),
  node TEXT COLLATE "C",        -- NULL: released
  epoch BIGINT NOT NULL,
  taken TIMESTAMPTZ NOT NULL,
  takeovers BIGINT NOT NULL,    -- how often it was taken from a daemon that was gone
  utime_us BIGINT,              -- of the last sample that a mission has taken in, and its number; the robot's clock
  sequence BIGINT
) WITH (fillfactor = 50);  -- updated with every commit

-- Programs that write, with their batches, so that a batch with an interrupted COMMIT is recognised.
CREATE TABLE cluster_writer (
  writer TEXT NOT NULL PRIMARY KEY,
  batch BIGINT NOT NULL,
  since TIMESTAMPTZ NOT NULL
);

-- Keys of missions are assigned in blocks of a thousand.
CREATE SEQUENCE cluster_mission_keys INCREMENT 1000 MINVALUE 1;

-- Diagnoses that wait or run, and the writer of the daemon that has each. Not a reference, for diagnoses can be distributed by
-- robot and this table cannot.
CREATE TABLE cluster_job (
  diagnosis_id BIGINT NOT NULL PRIMARY KEY,
  writer TEXT NOT NULL
);

-- The live state of each robot as its keeper last reported it. Not logged: a crash of the server empties it, and the keepers
-- fill it again within a second.
CREATE UNLOGGED TABLE cluster_live (
  robot_id TEXT COLLATE "C" NOT NULL PRIMARY KEY,
  node TEXT COLLATE "C" NOT NULL,
  epoch BIGINT NOT NULL,
  number BIGINT NOT NULL,  -- counts up under one epoch
  body BYTEA NOT NULL      -- src/ingest/fleet_view.h
) WITH (fillfactor = 50);
