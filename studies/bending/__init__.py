"""Bending laws against an independent evaluation, differential equations and tests."""
