"""Draping on a sphere, a cylinder and a cone, against exact solutions."""
