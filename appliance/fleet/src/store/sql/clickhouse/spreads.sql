SELECT serial, gauges.name AS name, gauges.low AS low, gauges.high AS high,
    count() AS n, avg(assumeNotNull(gauges.value)) AS mean, varSamp(assumeNotNull(gauges.value)) AS variance
FROM result FINAL ARRAY JOIN gauges WHERE at >= toDateTime($since) AND gauges.value IS NOT NULL
GROUP BY serial, name, low, high
