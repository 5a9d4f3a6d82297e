"""Scenes in space: strips, and plies that are laid on tools."""
