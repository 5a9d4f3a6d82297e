"""Parts of a load step: its search, the path that it keeps to, limits of loads."""
