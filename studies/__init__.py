"""Verification studies and benchmarks, outside the installed package."""
