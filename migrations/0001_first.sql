-- The store of cullmark. Portable on purpose: `$N` placeholders, integer times
-- (milliseconds since 1970, UTC), JSON as TEXT, so that Postgres can join later.

-- One row a submission. `series` tells repeated measurements of one study apart
-- (`run --series next`), so that a study can be compared with itself.
CREATE TABLE studies (
    id                 INTEGER PRIMARY KEY,
    name               TEXT   NOT NULL,
    series             BIGINT NOT NULL,
    title              TEXT   NOT NULL,
    manifest_toml      TEXT   NOT NULL,
    claims_json        TEXT   NOT NULL,
    policy_json        TEXT   NOT NULL,
    consolidate_frames BIGINT NOT NULL,
    machine_class      TEXT   NOT NULL,
    -- Hash of the run list: an unchanged submission rewrites nothing.
    runs_hash          TEXT   NOT NULL,
    created_ms         BIGINT NOT NULL,
    submitted_ms       BIGINT NOT NULL,
    UNIQUE (name, series)
);

-- The cells of a study in the order of its matrix. Measurements are shared:
-- the same cell in two studies is measured once.
CREATE TABLE study_runs (
    study_id        BIGINT NOT NULL,
    ordinal         BIGINT NOT NULL,
    -- Rank of the scene: trials are interleaved within a block.
    block           BIGINT NOT NULL,
    measurement_id  TEXT   NOT NULL,
    judgement_id    TEXT   NOT NULL,
    spec_json       TEXT   NOT NULL,
    structure_label TEXT   NOT NULL,
    culling_label   TEXT   NOT NULL,
    walk_label      TEXT   NOT NULL,
    PRIMARY KEY (study_id, ordinal)
);
CREATE INDEX study_runs_measurement ON study_runs (measurement_id, study_id);
CREATE INDEX study_runs_judgement ON study_runs (judgement_id, study_id);

CREATE TABLE excluded (
    study_id BIGINT NOT NULL,
    ordinal  BIGINT NOT NULL,
    cell     TEXT   NOT NULL,
    why      TEXT   NOT NULL,
    cells    BIGINT NOT NULL,
    PRIMARY KEY (study_id, ordinal)
);

-- What determines the submitted sets. `frames_hash` is set by whoever answers
-- first; every later trial and judgement must agree with it.
CREATE TABLE answers (
    answer_id   TEXT PRIMARY KEY,
    frames_hash TEXT,
    created_ms  BIGINT NOT NULL
);

CREATE TABLE measurements (
    measurement_id TEXT   PRIMARY KEY,
    answer_id      TEXT   NOT NULL,
    judgement_id   TEXT   NOT NULL,
    machine_class  TEXT   NOT NULL,
    series         BIGINT NOT NULL,
    protocol_json  TEXT   NOT NULL,
    -- pending | done | failed | wrong
    status         TEXT   NOT NULL,
    reason         TEXT,
    stop_reason    TEXT,
    -- Repeats accepted, and the width of the 95 % interval they reached over their median.
    repeats        BIGINT NOT NULL DEFAULT 0,
    relative_ci    DOUBLE PRECISION,
    created_ms     BIGINT NOT NULL,
    finished_ms    BIGINT
);

-- The queue. `trial`: target is a measurement; `judge`: target is a judgement.
-- state: queued | leased | done | failed | cancelled.
CREATE TABLE jobs (
    id             INTEGER PRIMARY KEY,
    kind           TEXT   NOT NULL,
    target         TEXT   NOT NULL,
    repeat_index   BIGINT NOT NULL,
    -- 0, or 1 for the second take of a noisy repeat.
    take           BIGINT NOT NULL,
    -- What jobs share (truth of a judgement, scene of a trial).
    group_key      TEXT   NOT NULL,
    order_key      BIGINT NOT NULL,
    state          TEXT   NOT NULL,
    owner          TEXT,
    epoch          BIGINT NOT NULL DEFAULT 0,
    lease_until_ms BIGINT NOT NULL DEFAULT 0,
    attempts       BIGINT NOT NULL DEFAULT 0,
    reason         TEXT,
    UNIQUE (kind, target, repeat_index, take)
);
CREATE INDEX jobs_queue ON jobs (kind, state, order_key);
CREATE INDEX jobs_leases ON jobs (state, lease_until_ms);
CREATE INDEX jobs_groups ON jobs (kind, group_key, state);

-- Every attempt of a job, also those that failed: evidence, not state.
CREATE TABLE attempts (
    job_id     BIGINT NOT NULL,
    epoch      BIGINT NOT NULL,
    owner      TEXT   NOT NULL,
    started_ms BIGINT NOT NULL,
    ended_ms   BIGINT,
    -- accepted | refused | timed_out | crashed | lost | returned | fenced
    outcome    TEXT,
    detail     TEXT,
    PRIMARY KEY (job_id, epoch)
);

CREATE TABLE trials (
    measurement_id TEXT   NOT NULL,
    repeat_index   BIGINT NOT NULL,
    take           BIGINT NOT NULL,
    accepted_ms    BIGINT NOT NULL,
    -- Of the whole child process, start and hand-over included.
    wall_ns        BIGINT NOT NULL,
    total_cull_ns  DOUBLE PRECISION NOT NULL,
    build_ns       BIGINT NOT NULL,
    prepare_ns     BIGINT NOT NULL,
    load_ns        BIGINT NOT NULL,
    peak_rss_bytes BIGINT NOT NULL,
    sentinel_ns    DOUBLE PRECISION NOT NULL,
    switches       BIGINT NOT NULL,
    -- Sentinel over the machine's median; 1 is quiet.
    noise          DOUBLE PRECISION NOT NULL,
    noisy          BIGINT NOT NULL,
    environment_id TEXT   NOT NULL,
    machine_class  TEXT   NOT NULL,
    frames_hash    TEXT   NOT NULL,
    -- Counted work: counters and a hash of each counted series. Must be equal between trials.
    work_json      TEXT   NOT NULL,
    -- The record without counters and series, which have their own tables.
    record_json    TEXT   NOT NULL,
    PRIMARY KEY (measurement_id, repeat_index, take)
);
CREATE INDEX trials_machine ON trials (machine_class, accepted_ms);

-- Per-frame numbers. Counted series are equal between trials and kept once,
-- under repeat_index -1. `role`: series | pass.
CREATE TABLE series (
    measurement_id TEXT   NOT NULL,
    repeat_index   BIGINT NOT NULL,
    take           BIGINT NOT NULL,
    role           TEXT   NOT NULL,
    ordinal        BIGINT NOT NULL,
    name           TEXT   NOT NULL,
    unit           TEXT   NOT NULL,
    data           BLOB   NOT NULL,
    PRIMARY KEY (measurement_id, repeat_index, take, role, ordinal)
);

-- Counters are data: a new one is no migration.
CREATE TABLE counters (
    measurement_id TEXT NOT NULL,
    name           TEXT NOT NULL,
    unit           TEXT NOT NULL,
    value          DOUBLE PRECISION NOT NULL,
    PRIMARY KEY (measurement_id, name)
);

CREATE TABLE judgements (
    judgement_id TEXT   PRIMARY KEY,
    answer_id    TEXT   NOT NULL,
    class        TEXT   NOT NULL,
    wrong        TEXT,
    frames_hash  TEXT   NOT NULL,
    record_json  TEXT   NOT NULL,
    accepted_ms  BIGINT NOT NULL,
    wall_ns      BIGINT NOT NULL
);

CREATE TABLE environments (
    environment_id   TEXT PRIMARY KEY,
    machine_class    TEXT NOT NULL,
    environment_json TEXT NOT NULL
);

-- Files that a study produced (its report): what, where, and the hash to tell a changed one.
CREATE TABLE artifacts (
    study_id   BIGINT NOT NULL,
    path       TEXT   NOT NULL,
    bytes      BIGINT NOT NULL,
    blake3     TEXT   NOT NULL,
    created_ms BIGINT NOT NULL,
    PRIMARY KEY (study_id, path)
);
