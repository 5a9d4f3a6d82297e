"""Kinematic nets: starts, darts, seams, courses, draped fibres and flat patterns."""
