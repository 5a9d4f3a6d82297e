"""Many cases in parallel, each result on file as soon as it is known."""

from .sweep import SweepError, sweep
from .workers import WorkerProcesses

__all__ = ["SweepError", "WorkerProcesses", "sweep"]
