"""Studies: many runs, put together into tables and figures."""
