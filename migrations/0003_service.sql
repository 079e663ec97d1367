-- What a service needs beside studies and results.

-- active | paused | cancelled
ALTER TABLE studies ADD COLUMN state TEXT NOT NULL DEFAULT 'active';
-- Higher first.
ALTER TABLE studies ADD COLUMN priority BIGINT NOT NULL DEFAULT 0;
-- Time given to it on the measuring lane and beside it: who had least is next.
ALTER TABLE studies ADD COLUMN lane_ms BIGINT NOT NULL DEFAULT 0;
ALTER TABLE studies ADD COLUMN beside_ms BIGINT NOT NULL DEFAULT 0;
-- Profile of the program whose trials these are; '' where it is not known.
ALTER TABLE studies ADD COLUMN build_profile TEXT NOT NULL DEFAULT '';
-- Where files that the manifest names start from; '' where it is not known.
ALTER TABLE studies ADD COLUMN folder TEXT NOT NULL DEFAULT '';
-- What its report was written from; '' before there is one.
ALTER TABLE studies ADD COLUMN report_key TEXT NOT NULL DEFAULT '';

-- Whose turn a job is. Jobs are shared, as measurements are: this is the study that
-- asked first, or one that still wants it.
ALTER TABLE jobs ADD COLUMN study_id BIGINT NOT NULL DEFAULT 0;
UPDATE jobs SET study_id = coalesce((SELECT min(r.study_id) FROM study_runs r WHERE r.measurement_id = jobs.target), 0)
    WHERE kind = 'trial';
UPDATE jobs SET study_id = coalesce((SELECT min(r.study_id) FROM study_runs r WHERE r.judgement_id = jobs.target), 0)
    WHERE kind = 'judge';
CREATE INDEX jobs_study ON jobs (study_id, kind, state, order_key);
CREATE INDEX attempts_outcome ON attempts (outcome);

-- Ticks with every change of a measurement, so that readers ask for what is new only.
CREATE TABLE clock (
    id  INTEGER PRIMARY KEY CHECK (id = 1),
    now BIGINT NOT NULL
);
INSERT INTO clock (id, now) VALUES (1, 1);
ALTER TABLE measurements ADD COLUMN changed BIGINT NOT NULL DEFAULT 1;
CREATE INDEX measurements_changed ON measurements (changed);

-- Metrics of a run as the program computed them: a cache, void when `changed` or `revision` differ.
CREATE TABLE facts (
    measurement_id TEXT   NOT NULL,
    judgement_id   TEXT   NOT NULL,
    changed        BIGINT NOT NULL,
    revision       TEXT   NOT NULL,
    data           BLOB   NOT NULL,
    PRIMARY KEY (measurement_id, judgement_id)
);

-- Single settings of the service, such as a paused pool.
CREATE TABLE settings (
    name  TEXT PRIMARY KEY,
    value TEXT NOT NULL
);

-- Of a token only the hash is kept.
CREATE TABLE tokens (
    id         INTEGER PRIMARY KEY,
    name       TEXT   NOT NULL UNIQUE,
    -- read | submit | admin
    role       TEXT   NOT NULL,
    hash       TEXT   NOT NULL UNIQUE,
    created_ms BIGINT NOT NULL,
    used_ms    BIGINT
);

-- Files that users sent: content-addressed, checked before they are kept.
CREATE TABLE uploads (
    id          TEXT   PRIMARY KEY,
    -- scene | path
    kind        TEXT   NOT NULL,
    name        TEXT   NOT NULL,
    bytes       BIGINT NOT NULL,
    triangles   BIGINT,
    frames      BIGINT,
    notes_json  TEXT   NOT NULL,
    uploaded_ms BIGINT NOT NULL
);
CREATE INDEX uploads_name ON uploads (name, uploaded_ms);

-- What is asked often of studies of a hundred thousand runs, and was looked for row by row.
-- Whose judgement it is.
CREATE INDEX measurements_judgement ON measurements (judgement_id);
-- Runs that lack a decision: few, or being worked on.
CREATE INDEX measurements_pending ON measurements (measurement_id) WHERE status = 'pending';
-- Where a study was measured.
CREATE INDEX trials_environment ON trials (environment_id, measurement_id);
