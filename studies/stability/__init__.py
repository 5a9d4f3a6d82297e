"""Stiff and extreme cases: counts of correct, rejected and wrong results."""
