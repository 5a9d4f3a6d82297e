"""The command ``list``: names and descriptions of the scenes."""

import argparse

from ..cases.scenes import SCENES
from ..cases.schema import summary_of
from .output import say


def run(options: argparse.Namespace) -> int:
    """Print a line for each scene; returns the exit code."""
    width = max(map(len, SCENES)) + 2
    for name, scene in SCENES.items():
        say(f"{name:{width}}{summary_of(scene)}")
    return 0
