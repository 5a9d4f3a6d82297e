"""Error against run time, compared with other codes: 1.5 h."""
