-- Results as the heads sent them. A row that came twice stays twice until the server merges its parts: read result_once.
CREATE TABLE IF NOT EXISTS result$local (
    serial String,
    history String,
    seq UInt32,
    -- When it was triggered, UTC; where the head does not know, the hour in which it was received.
    at DateTime,
    at_unix_ms Nullable(UInt64),
    clock String,
    received_unix_ms UInt64,
    recipe UInt16,
    fingerprint String,
    part_id UInt32,
    press_stroke UInt32,
    verdict String,
    error_code UInt16,
    flags UInt16,
    exposure_us UInt32,
    processing_us UInt32,
    coverage Float64,
    -- x, y, z in mm and three turns in degrees; empty where the part was not aligned.
    placement Array(Nullable(Float64)),
    gauges Nested(
        slot UInt16,
        name String,
        unit String,
        value Nullable(Float64),
        sigma Nullable(Float64),
        u Nullable(Float64),
        low Nullable(Float64),
        high Nullable(Float64),
        decision UInt16,
        reason Nullable(String)
    )
) ENGINE = $result PARTITION BY toYYYYMM(at) ORDER BY (at, serial, history, seq);

-- When each result was triggered: rows of `result` lie in the order of time, and this finds one of a head.
CREATE TABLE IF NOT EXISTS result_at$local (
    serial String,
    history String,
    seq UInt32,
    at DateTime
) ENGINE = $result_at PARTITION BY toYYYYMM(at) ORDER BY (serial, history, seq);

CREATE MATERIALIZED VIEW IF NOT EXISTS result_at_of TO result_at$local
AS SELECT serial, history, seq, at FROM result$local;

-- Results that a head deleted before anybody fetched them: first to last SEQ.
CREATE TABLE IF NOT EXISTS gap$local (
    serial String,
    history String,
    first UInt32,
    last UInt32
) ENGINE = $gap ORDER BY (serial, history, first);

-- The last answer and the state of each head.
CREATE TABLE IF NOT EXISTS head$local (
    url String,
    line String,
    serial String,
    history String,
    seq UInt32,
    updated_unix_ms UInt64,
    reachable UInt8,
    error String,
    state String,
    recipe Nullable(UInt16),
    recipe_name String,
    drift_px Nullable(Float64),
    last_result_unix_ms Nullable(UInt64)
) ENGINE = $head ORDER BY url;
