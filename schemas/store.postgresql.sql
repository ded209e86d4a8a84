-- What a history in PostgreSQL has in addition to the tables of store.sql, which src/history/schema.cc translates.

ALTER TABLE joulecast_store ADD schema_version BIGINT NOT NULL;

ALTER TABLE robot ADD FOREIGN KEY (robot_id, active_version) REFERENCES model (robot_id, version);

CREATE FUNCTION model_is_immutable() RETURNS trigger LANGUAGE plpgsql AS
$$BEGIN RAISE EXCEPTION 'a model version never changes'; END$$;
CREATE TRIGGER model_is_immutable BEFORE UPDATE ON model EXECUTE FUNCTION model_is_immutable();

CREATE FUNCTION audit_is_appended_to() RETURNS trigger LANGUAGE plpgsql AS
$$BEGIN RAISE EXCEPTION 'the audit is only appended to'; END$$;
CREATE TRIGGER audit_keeps_entries BEFORE DELETE OR TRUNCATE ON audit EXECUTE FUNCTION audit_is_appended_to();
CREATE TRIGGER audit_keeps_content BEFORE UPDATE ON audit EXECUTE FUNCTION audit_is_appended_to();

-- Open missions are updated every second: in their own page.
ALTER TABLE mission SET (fillfactor = 70);

-- Chunks that are not sealed are replaced every second.
ALTER TABLE telemetry_chunk SET (autovacuum_vacuum_scale_factor = 0.05);
ALTER TABLE covariate_chunk SET (autovacuum_vacuum_scale_factor = 0.05);

-- Compressed already.
ALTER TABLE telemetry_chunk ALTER body SET STORAGE EXTERNAL;
ALTER TABLE covariate_chunk ALTER body SET STORAGE EXTERNAL;
ALTER TABLE floor_plan ALTER image SET STORAGE EXTERNAL;
