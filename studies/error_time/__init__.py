"""Error against run time, beside other codes: an hour and a half."""
