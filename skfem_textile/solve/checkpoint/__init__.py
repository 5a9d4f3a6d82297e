"""A run on disk, to go on from after an interruption."""

from .checkpoint import Checkpoint, CheckpointError, Saved
from .contents import Progress
from .replay import Replay

__all__ = ["Checkpoint", "CheckpointError", "Progress", "Replay", "Saved"]
