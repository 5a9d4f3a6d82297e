"""Equilibria under a growing load: conditions, steps, and checks of states."""
