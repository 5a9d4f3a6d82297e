"""Scenes of strips in space."""
