"""Equilibria under a growing load: conditions, steps, and what is asked of a state."""
