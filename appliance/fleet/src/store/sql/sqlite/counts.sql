SELECT json_object('serial', serial, 'results', count(*), 'pass', sum(verdict = 'PASS'), 'last_at', max(at))
FROM result WHERE at >= $since GROUP BY serial
