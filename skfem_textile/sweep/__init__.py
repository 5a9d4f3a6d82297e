"""Many cases side by side, each result on disk as soon as it comes."""

from .sweep import SweepError, sweep
from .workers import WorkerProcesses

__all__ = ["SweepError", "WorkerProcesses", "sweep"]
