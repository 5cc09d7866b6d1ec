SELECT json_object('url', url, 'line', line, 'serial', serial, 'history', history, 'seq', seq, 'updated_unix_ms', updated_unix_ms,
    'reachable', reachable, 'error', error, 'state', state, 'recipe', recipe, 'recipe_name', recipe_name, 'drift_px', drift_px,
    'last_result_unix_ms', last_result_unix_ms)
FROM head ORDER BY url
