-- As in the other stores, where a row may be there twice.
CREATE VIEW IF NOT EXISTS result_once AS SELECT * FROM result;
CREATE VIEW IF NOT EXISTS gap_once AS SELECT * FROM gap;
CREATE VIEW IF NOT EXISTS head_once AS SELECT * FROM head;

-- Each gauge of each result, once.
CREATE VIEW IF NOT EXISTS gauge_once AS SELECT
    serial, history, seq, at, recipe, fingerprint, part_id, press_stroke, verdict,
    json_extract(one.value, '$.slot') AS slot, json_extract(one.value, '$.name') AS name, json_extract(one.value, '$.unit') AS unit,
    json_extract(one.value, '$.value') AS value, json_extract(one.value, '$.sigma') AS sigma, json_extract(one.value, '$.u') AS u,
    json_extract(one.value, '$.low') AS low, json_extract(one.value, '$.high') AS high,
    json_extract(one.value, '$.decision') AS decision, json_extract(one.value, '$.reason') AS reason
FROM result, json_each(result.gauges) AS one;

-- Yield of a head and a recipe: passed of all, those included that could not be judged.
CREATE VIEW IF NOT EXISTS yield_$period AS SELECT
    serial, recipe, $start AS $period, count(*) AS results,
    sum(verdict = 'PASS') AS pass, sum(verdict = 'FAIL') AS fail, sum(verdict = 'INVALID') AS invalid,
    avg(verdict = 'PASS') AS yield
FROM result GROUP BY serial, recipe, $period;

-- Values of a gauge: number, mean and standard deviation, Cp and Cpk (ISO 22514-2) where there are limits. Other limits begin another row.
CREATE VIEW IF NOT EXISTS gauge_$period AS SELECT
    serial, recipe, slot, name, unit, low, high, $period, n, mean, s, (high - low) / (6 * s) AS cp,
    min(coalesce((mean - low) / (3 * s), (high - mean) / (3 * s)), coalesce((high - mean) / (3 * s), (mean - low) / (3 * s))) AS cpk
FROM (
    SELECT serial, recipe, slot, name, unit, low, high, $period, n, mean, nullif(sqrt(max(squares - n * mean * mean, 0) / (n - 1)), 0) AS s
    FROM (
        SELECT serial, recipe, slot, name, unit, low, high, $start AS $period,
            count(value) AS n, avg(value) AS mean, sum(value * value) AS squares
        FROM gauge_once WHERE value IS NOT NULL
        GROUP BY serial, recipe, slot, name, unit, low, high, $period
    )
);
