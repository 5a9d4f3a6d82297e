"""Refinement to a tolerance, and the estimated error against references."""
