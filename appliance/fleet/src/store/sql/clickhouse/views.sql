-- Each result once.
CREATE VIEW IF NOT EXISTS result_once AS SELECT * FROM result FINAL;

CREATE VIEW IF NOT EXISTS gap_once AS SELECT * FROM gap FINAL;

CREATE VIEW IF NOT EXISTS head_once AS SELECT * FROM head FINAL;

-- Each gauge of each result, once.
CREATE VIEW IF NOT EXISTS gauge_once AS SELECT
    serial, history, seq, at, recipe, fingerprint, part_id, press_stroke, verdict,
    gauges.slot AS slot, gauges.name AS name, gauges.unit AS unit, gauges.value AS value, gauges.sigma AS sigma, gauges.u AS u,
    gauges.low AS low, gauges.high AS high, gauges.decision AS decision, gauges.reason AS reason
FROM result FINAL ARRAY JOIN gauges;

-- Yield of a head and a recipe: passed of all, those included that could not be judged.
CREATE VIEW IF NOT EXISTS yield_$period AS SELECT
    serial, recipe, $start AS $period,
    count() AS results, countIf(verdict = 'PASS') AS pass, countIf(verdict = 'FAIL') AS fail, countIf(verdict = 'INVALID') AS invalid,
    pass / results AS yield
FROM result FINAL GROUP BY serial, recipe, $period;

-- Values of a gauge: number, mean and standard deviation, Cp and Cpk (ISO 22514-2) where there are limits. Other limits begin another row.
CREATE VIEW IF NOT EXISTS gauge_$period AS SELECT
    serial, recipe, slot, name, unit, low, high, $period, n, mean, s,
    if(s > 0, (high - low) / (6 * s), NULL) AS cp,
    if(s > 0, if(low IS NULL, above, if(high IS NULL, below, least(assumeNotNull(below), assumeNotNull(above)))), NULL) AS cpk
FROM (
    SELECT serial, recipe, slot, name, unit, low, high, $period, n, mean, s,
        (mean - low) / (3 * s) AS below, (high - mean) / (3 * s) AS above
    FROM (
        SELECT serial, recipe, slot, name, unit, low, high, $start AS $period,
            count(value) AS n, avg(assumeNotNull(value)) AS mean, stddevSamp(assumeNotNull(value)) AS s
        FROM gauge_once WHERE value IS NOT NULL
        GROUP BY serial, recipe, slot, name, unit, low, high, $period
    )
);
