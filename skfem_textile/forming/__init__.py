"""Forming: rigid tools that move, and a ply that slides between them."""

from .holder import Holder
from .tool import Tool

__all__ = ["Holder", "Tool"]
