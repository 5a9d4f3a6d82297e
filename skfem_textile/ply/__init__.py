"""Ply model: mesh, fabric, formulation and further terms as a function of
displacement.
"""

from .ply import Ply

__all__ = ["Ply"]
