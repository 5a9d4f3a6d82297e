"""A run on disk, to go on from after an interruption."""

from .checkpoint import Checkpoint, CheckpointError, Progress, Saved

__all__ = ["Checkpoint", "CheckpointError", "Progress", "Saved"]
