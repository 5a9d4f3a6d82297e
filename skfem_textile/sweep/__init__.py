"""Many cases side by side, kept on disk as they end."""

from .processes import Processes
from .sweep import SweepError, sweep

__all__ = ["Processes", "SweepError", "sweep"]
