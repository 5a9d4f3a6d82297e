"""Public names, which the package imports on first use."""

from .ply import (
    Ply as Ply,
)
