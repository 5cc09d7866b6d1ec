-- Of the last 200 results of each head: more take minutes where a day has millions.
SELECT json_object('serial', serial, 'name', name, 'low', low, 'high', high, 'n', n, 'mean', mean,
    'variance', CASE WHEN n > 1 THEN max(squares - n * mean * mean, 0) / (n - 1) END)
FROM (
    SELECT serial, json_extract(one.value, '$.name') AS name, json_extract(one.value, '$.low') AS low,
        json_extract(one.value, '$.high') AS high, count(*) AS n, avg(json_extract(one.value, '$.value')) AS mean,
        sum(json_extract(one.value, '$.value') * json_extract(one.value, '$.value')) AS squares
    FROM (SELECT DISTINCT serial AS of FROM head)
    CROSS JOIN result ON result.rowid IN (
        SELECT rowid FROM result WHERE serial = of AND at >= $since ORDER BY at DESC LIMIT 200
    ), json_each(result.gauges) AS one
    WHERE json_extract(one.value, '$.value') IS NOT NULL GROUP BY serial, name, low, high
)
