SELECT * FROM head_once ORDER BY url
