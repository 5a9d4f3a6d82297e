"""Pictures of a run."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from ..scenes.scene import Case
from ..solve.result import Result, StepError
from .curve import (
    ANGLE,
    DISPLACEMENT,
    FORCE,
    HALF_WIDTH,
    HIGH,
    LOW,
    NORMALISED,
    Curve,
    completed,
)
from .imports import uncollected
from .interruption import held

#: Pictures of a ply, and their captions, in the order of a report.
PICTURES = {
    "refused.png": "Last converged state; the elements of the rejected step are marked",
    "shear_angle.png": "Shear angle in the state of the results",
    "draped.png": "Shear angle and contact pressure on the tool",
    "formed.png": "Shear angle, fibres and areal weight, with the tools",
    "section.png": "Section through ply and tools at several load factors",
    "phases.png": "Shear angle at the end of each phase",
    "tool_force.png": "Force of tools and clamps on the ply over the travel",
    "samples.png": "Force of the run with the error interval of its mesh, and with the "
    "band of further specimens of the fabric",
    "fibre_strain.png": "Fibre strain in the state of the results",
    "fibre_directions.png": "Fibre directions in the state of the results",
    "animation.gif": "Shear angle during loading",
}

#: Names of the pictures of the plies of a stack.
OF_PLIES = "ply_[0-9]*.png"


def captions(folder: Path) -> dict[str, str]:
    """Captions of the pictures in a folder, in the order of a report."""
    found = dict[str, str]()
    for name, caption in PICTURES.items():
        found[name] = caption
        for file in sorted(folder.glob(f"ply_[0-9]*_{name}")):
            number = file.name.split("_")[1]
            found[file.name] = f"Ply {number}: {caption[0].lower()}{caption[1:]}"
    return found


#: Pictures of a curve: titles, abscissa and ordinate.
CURVES = {
    "load.png": ("Force against displacement", DISPLACEMENT, FORCE),
    "load_by_angle.png": ("Force against shear angle", ANGLE, FORCE),
    "normalised_load.png": ("Normalised shear force", ANGLE, NORMALISED),
}


def draw(
    case: Case,
    run: Result | StepError,
    curve: Curve,
    test: Curve | None,
    folder: Path,
) -> None:
    """Draw all pictures into a folder; signals wait until the current one is done.

    For a run that stopped early: pictures of its result, and where it stopped.  Without
    a test curve, the forces of the tools are the only plot of a ply between tools.
    """
    result = run.result if isinstance(run, StepError) else run
    scene, process = case.scene, case.scene.process
    with held(), uncollected():  # VTK may crash if it is interrupted
        from .. import plot
        from ..io.results import has_tools

        names = ["fibre_strain.png", "shear_angle.png", "fibre_directions.png"]
        if result.tool(1.0) is not None and not result.not_on_tool:
            names.append("draped.png")
        names += ["formed.png"] * (between := has_tools(result.ply))
        drawn: dict[str, dict[str, Any]] = {name: {} for name in names}
        drawn |= {"section.png": {}, "tool_force.png": {}} if between else {}
        if process and (ends := process.at_ends(result)):
            drawn["section.png"] = {"states": ends}
            drawn["tool_force.png"] = drawn["phases.png"] = {"process": process}
        drawn["animation.gif"] = {}
        pictures = {name: getattr(plot, Path(name).stem) for name in drawn}
        described = case.described(result)
    for name, options in drawn.items():
        with held():
            of = described if name in names else result
            if name in names and of.plies:
                for i, of_ply in enumerate(of.plies, 1):
                    file = folder / f"ply_{i}_{name}"
                    pictures[name](of_ply, filename=file, **options)
            else:
                pictures[name](of, filename=folder / name, **options)
    if isinstance(run, StepError):
        with held():
            plot.verdict(run, filename=folder / "refused.png")
    if LOW in curve and np.any(curve[FORCE]):
        _draw_samples(curve, folder)
    measured = completed(test, scene.shear_test) if test else None
    of_tool = between and scene.driven not in scene.conditions
    if measured is None and of_tool:
        return
    draw_curves(curve, measured, folder, loops=scene.programme is not None)


def _draw_samples(curve: Curve, folder: Path) -> None:
    """Draw the force with its error interval, and beside it with the samples."""
    with held():
        from ..plot.curves import curves
    x, along = curve[DISPLACEMENT], _axis(DISPLACEMENT)
    if not _is_monotonic(x):
        x, along = np.arange(len(x)), "State"
    line, mesh = (x, curve[FORCE]), _band(curve, FORCE)
    panels: dict[str, dict[str, tuple[ndarray, ...]]] = {
        "Mesh" if mesh else "Mesh: no error interval": {"run": (*line, *mesh)},
        "Fabric": {"run": (*line, curve[LOW], curve[HIGH])},
    }
    with held():
        curves(panels, along, _axis(FORCE), folder / "samples.png", same_scales=True)


def draw_curves(
    run: Curve, test: Curve | None, folder: Path, loops: bool = False
) -> None:
    """Draw the `CURVES` for which run or test contain the columns.

    A run without a force is drawn only together with a test.  Half-widths of the force
    are drawn as bands.  A run is drawn over its states, without the test, if its
    abscissa does not increase or decrease throughout, unless it has ``loops``.
    """
    from ..plot.curves import curves

    for name, (_, x, y) in CURVES.items():
        both = {"run": run, "test": test or {}}
        lines = {
            label: (curve[x], curve[y], *_band(curve, y))
            for label, curve in both.items()
            if x in curve and y in curve
        }
        if "run" in lines and any(np.any(line[1]) for line in lines.values()):
            along = _axis(x)
            if not (loops or _is_monotonic(lines["run"][0])):
                states, along = np.arange(len(lines["run"][0])), "State"
                lines = {"run": (states, *lines["run"][1:])}
            curves({"": lines}, along, _axis(y), folder / name)


def _is_monotonic(x: ndarray) -> bool:
    """True if a curve is a function of x."""
    step = np.diff(x)
    return bool((step > 0).all() or (step < 0).all())


def _band(curve: Curve, y: str) -> tuple[ndarray, ...]:
    """Half-widths of a column of forces, if the curve contains them."""
    return (curve[HALF_WIDTH],) if y == FORCE and HALF_WIDTH in curve else ()


def _axis(heading: str) -> str:
    """Axis label for a heading."""
    heading = heading.replace("(deg)", "(°)")
    return heading[:1].upper() + heading[1:]
