"""Stiff and extreme cases: which end right, which are refused, and which wrong."""
