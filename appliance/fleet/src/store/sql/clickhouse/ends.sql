SELECT serial, history, max(seq) AS seq FROM result GROUP BY serial, history
