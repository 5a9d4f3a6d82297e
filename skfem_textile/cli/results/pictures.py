"""The pictures of a run."""

from pathlib import Path

import numpy as np

from ...scenes import Scene
from ...solve.result import Result, StepError
from ..case.curve import Curve, completed, curve_of
from ..interruption import held
from .curves_of_tests import ANGLE, DISPLACEMENT, FORCE, NORMALISED

#: Files of the pictures of every run.
PICTURES = (
    "fibre_strain.png",
    "shear_angle.png",
    "fibre_directions.png",
    "load.png",
    "animation.gif",
)

#: Files of the further pictures of a shear test.
OF_SHEAR_TESTS = ("load_by_angle.png", "normalised_load.png")

#: File of the further picture of a ply on a tool.
DRAPED = "draped.png"

#: File of the picture of a run that stopped early.
REFUSED = "refused.png"

#: Pictures of a curve: their titles, and what is drawn over what.
CURVES = {
    "load.png": ("Force against displacement", DISPLACEMENT, FORCE),
    "load_by_angle.png": ("Force against shear angle", ANGLE, FORCE),
    "normalised_load.png": ("Normalised shear force", ANGLE, NORMALISED),
}


def draw(
    scene: Scene, run: Result | StepError, test: Curve | None, folder: Path
) -> None:
    """Draw all pictures into a folder; a signal waits until the current one is done.

    Of a run that stopped early they are those of its result, and where it stopped.
    """
    stopped = isinstance(run, StepError)
    result = run.result if isinstance(run, StepError) else run
    with held():  # VTK may crash if it is interrupted
        from ... import plot
    for name, picture in (
        ("fibre_strain.png", plot.fibre_strain),
        ("shear_angle.png", plot.shear_angle),
        ("fibre_directions.png", plot.fibre_directions),
    ):
        with held():
            picture(result, filename=folder / name)
    if result.tool(result.states[-1].load_factor) is not None:
        with held():
            plot.draped(result, filename=folder / DRAPED)
    if stopped:
        with held():
            plot.verdict(run, filename=folder / REFUSED)
    with held():
        plot.animation(result, folder / "animation.gif")
    measured = completed(test, scene.shear_test) if test else None
    draw_curves(curve_of(scene, result), measured, folder)


def draw_curves(run: Curve, test: Curve | None, folder: Path) -> None:
    """Draw what `CURVES` says into a folder, as far as run or test have the columns.

    A run without a force is not drawn by itself.
    """
    from ...plot.curves import curves

    for name, (title, x, y) in CURVES.items():
        both = {"run": run, "test": test or {}}
        lines = {
            label: (curve[x], curve[y])
            for label, curve in both.items()
            if x in curve and y in curve
        }
        if "run" in lines and any(np.any(force) for _, force in lines.values()):
            curves({title: lines}, _axis(x), _axis(y), folder / name)


def _axis(heading: str) -> str:
    """What stands on an axis for a heading."""
    heading = heading.replace("(deg)", "(°)")
    return heading[:1].upper() + heading[1:]
