"""Benchmarks: where the time of a run goes, and how it compares with other codes."""
