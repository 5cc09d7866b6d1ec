-- Results as the heads sent them, each once.
CREATE TABLE IF NOT EXISTS result (
    serial TEXT NOT NULL,
    history TEXT NOT NULL,
    seq INTEGER NOT NULL,
    -- When it was triggered, s since 1970 UTC; where the head does not know, the hour in which it was received.
    at INTEGER NOT NULL,
    at_unix_ms INTEGER,
    clock TEXT NOT NULL,
    received_unix_ms INTEGER NOT NULL,
    recipe INTEGER NOT NULL,
    fingerprint TEXT NOT NULL,
    part_id INTEGER NOT NULL,
    press_stroke INTEGER NOT NULL,
    verdict TEXT NOT NULL,
    error_code INTEGER NOT NULL,
    flags INTEGER NOT NULL,
    exposure_us INTEGER NOT NULL,
    processing_us INTEGER NOT NULL,
    coverage REAL NOT NULL,
    -- x, y, z in mm and three turns in degrees, as JSON; NULL where the part was not aligned.
    placement TEXT,
    -- As the head sent them, as JSON: read gauge_once.
    gauges TEXT NOT NULL,
    -- With row numbers of its own: without them each row, longer than a quarter of a page, takes a page more.
    PRIMARY KEY (serial, history, seq)
);
CREATE INDEX IF NOT EXISTS result_at ON result (at);
CREATE INDEX IF NOT EXISTS result_head ON result (serial, at, verdict);

-- Results that a head deleted before anybody fetched them: first to last SEQ.
CREATE TABLE IF NOT EXISTS gap (
    serial TEXT NOT NULL,
    history TEXT NOT NULL,
    first INTEGER NOT NULL,
    last INTEGER NOT NULL,
    PRIMARY KEY (serial, history, first)
) WITHOUT ROWID;

-- The last answer and the state of each head.
CREATE TABLE IF NOT EXISTS head (
    url TEXT PRIMARY KEY,
    line TEXT NOT NULL,
    serial TEXT NOT NULL,
    history TEXT NOT NULL,
    seq INTEGER NOT NULL,
    updated_unix_ms INTEGER NOT NULL,
    reachable INTEGER NOT NULL,
    error TEXT NOT NULL,
    state TEXT NOT NULL,
    recipe INTEGER,
    recipe_name TEXT NOT NULL,
    drift_px REAL,
    last_result_unix_ms INTEGER
) WITHOUT ROWID;
