SELECT serial, count() AS results, countIf(verdict = 'PASS') AS pass, max(toUInt64(toUnixTimestamp(at))) AS last_at
FROM result FINAL WHERE at >= toDateTime($since) GROUP BY serial
