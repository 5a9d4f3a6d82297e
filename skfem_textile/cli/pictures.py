"""The pictures of a run."""

from pathlib import Path

import numpy as np

from ..scenes import Scene
from ..solve.result import Result
from .interruption import held

#: Files of the pictures.
PICTURES = (
    "fibre_strain.png",
    "shear_angle.png",
    "fibre_directions.png",
    "load.png",
    "animation.gif",
)


def draw(scene: Scene, result: Result, folder: Path) -> None:
    """Draw all pictures into a folder; a signal waits until the current one is done."""
    with held():  # VTK may crash if it is interrupted
        from .. import plot
    for name, picture in (
        ("fibre_strain.png", plot.fibre_strain),
        ("shear_angle.png", plot.shear_angle),
        ("fibre_directions.png", plot.fibre_directions),
    ):
        with held():
            picture(result, filename=folder / name)
    with held():
        plot.animation(result, folder / "animation.gif")
    _draw_load(scene, result, folder / "load.png")


def _draw_load(scene: Scene, result: Result, file: Path) -> None:
    """Draw the force on the driven edge over its displacement."""
    from ..plot.curves import curves

    moved = np.array([scene.driven_displacement(state) for state in result.states])
    axis = np.abs(moved).max(axis=0).argmax()  # along which the edge moves further
    x, y = np.transpose([scene.reaction(state) for state in result.states])
    lines = {"along x": (moved[:, axis], x), "along y": (moved[:, axis], y)}
    curves(
        {"Force on the driven edge": lines},
        f"Mean displacement of the driven edge along {'xy'[axis]} (mm)",
        "Force (N)",
        file,
    )
