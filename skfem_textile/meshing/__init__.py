"""Meshes that the package makes."""

from .along_fibres import mesh_along_fibres

__all__ = ["mesh_along_fibres"]
