-- Head by head, from an index that has all of it.
SELECT json_object('serial', of, 'results', (SELECT count(*) FROM result WHERE serial = of AND at >= $since),
    'pass', (SELECT count(*) FROM result WHERE serial = of AND at >= $since AND verdict = 'PASS'),
    'last_at', (SELECT max(at) FROM result WHERE serial = of AND at >= $since))
FROM (SELECT DISTINCT serial AS of FROM head) WHERE EXISTS (SELECT 1 FROM result WHERE serial = of AND at >= $since)
