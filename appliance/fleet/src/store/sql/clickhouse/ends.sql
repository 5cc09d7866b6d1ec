SELECT serial, history, max(seq) AS seq FROM result_at GROUP BY serial, history
