SELECT json_object('serial', serial, 'history', history, 'seq', max(seq)) FROM result GROUP BY serial, history
