"""Errors of strain, load and shape for every formulation on every scene."""
