"""Benchmarks: breakdown of the run time, and comparison with other codes."""
