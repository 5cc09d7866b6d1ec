SELECT json_object('serial', serial, 'name', name, 'low', low, 'high', high, 'n', n, 'mean', mean,
    'variance', CASE WHEN n > 1 THEN max(squares - n * mean * mean, 0) / (n - 1) END)
FROM (
    SELECT serial, name, low, high, count(*) AS n, avg(value) AS mean, sum(value * value) AS squares
    FROM gauge_once WHERE at >= $since AND value IS NOT NULL GROUP BY serial, name, low, high
)
