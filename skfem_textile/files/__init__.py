"""Files and streams: locks, signals, and what is said where one cannot write."""
