"""Pictures of a run, and export of fibres and flat patterns of draped plies."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy import ndarray

from .. import io
from ..cases.schema import Output
from ..mesh.checks import MeshError
from ..mesh.requirements import is_installed, lacks
from ..mesh.user_input import printable
from ..nets.flat_pattern import FlatPattern, flat_pattern
from ..nets.sheet import Sheet, fibres_on_tool
from ..scenes import Scene
from ..solve.quantities import Quantity
from ..solve.result import Result, StepError
from ..surfaces.surface import Axes
from ..surfaces.tool_mesh import ToolMesh
from .curve import (
    ANGLE,
    DISPLACEMENT,
    FORCE,
    HALF_WIDTH,
    NORMALISED,
    Curve,
    completed,
)
from .interruption import held
from .output import say

#: Pictures of every run.
PICTURES = (
    "fibre_strain.png",
    "shear_angle.png",
    "fibre_directions.png",
    "load.png",
    "animation.gif",
)

#: Additional pictures of shear tests.
OF_SHEAR_TESTS = ("load_by_angle.png", "normalised_load.png")

#: Additional picture of a ply on a tool.
DRAPED = "draped.png"

#: Additional pictures of a ply between tools.
FORMED = ("formed.png", "section.png", "tool_force.png")

#: Picture of a run that stopped early.
REFUSED = "refused.png"

#: Pictures of a curve: titles, abscissa and ordinate.
CURVES = {
    "load.png": ("Force against displacement", DISPLACEMENT, FORCE),
    "load_by_angle.png": ("Force against shear angle", ANGLE, FORCE),
    "normalised_load.png": ("Normalised shear force", ANGLE, NORMALISED),
}


def draw(
    scene: Scene,
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
    with held():  # VTK may crash if it is interrupted
        from .. import plot
        from ..io.results import has_tools
    pictures: dict[str, tuple[Callable[..., Any], Any]] = {
        "fibre_strain.png": (plot.fibre_strain, result),
        "shear_angle.png": (plot.shear_angle, result),
        "fibre_directions.png": (plot.fibre_directions, result),
    }
    if result.tool(1.0) is not None and not result.not_on_tool:
        pictures[DRAPED] = plot.draped, result
    if has_tools(result.ply):
        pictures |= {
            "formed.png": (plot.formed, result),
            "section.png": (plot.section, result),
            "tool_force.png": (plot.tool_force, result),
        }
    if isinstance(run, StepError):
        pictures[REFUSED] = plot.verdict, run
    pictures["animation.gif"] = plot.animation, result
    for name, (picture, of) in pictures.items():
        with held():
            picture(of, filename=folder / name)
    measured = completed(test, scene.shear_test) if test else None
    of_tool = "tool_force.png" in pictures and scene.driven not in scene.conditions
    if measured is None and of_tool:
        return
    draw_curves(curve, measured, folder)


def draw_curves(run: Curve, test: Curve | None, folder: Path) -> None:
    """Draw the `CURVES` for which run or test contain the columns.

    A run without a force is drawn only together with a test.  Half-widths of the force
    are drawn as bands.  A run is drawn over its states, without the test, if its
    abscissa does not increase or decrease throughout.
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
            if not _is_monotonic(lines["run"][0]):
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


_PART = ("part.vtu", "part.csv", "part.inp")

#: Files of flat patterns.
PATTERN = ("pattern.csv", "pattern.svg", "pattern.dxf")


def write_patterns(folder: Path, patterns: Sequence[FlatPattern]) -> None:
    """Write flat patterns to all `PATTERN` files; a .dxf only if ezdxf is installed."""
    for name in PATTERN:
        if name.endswith("dxf") and not is_installed("ezdxf"):
            say(f"not written: {lacks(name, 'dxf', 'ezdxf')}")
        else:
            io.write_pattern(folder / name, patterns)


# Figures of exports that are printed, or the reasons why there are none.
_FIRST = (
    Quantity("Part", "part"),
    Quantity(
        *("Part covered", "part_covered_share_of_elements", "%"),
        note=" of its elements",
    ),
    Quantity("Flat pattern", "pattern"),
    Quantity("Flat pattern", "pattern_area_mm2", "mm²"),
)


@dataclass(frozen=True, eq=False)
class DrapeExport:
    """Export of a draped ply: elements of the part, and curves that trim the pattern.

    ``curves`` are closed, each (3, n); ``no_curves`` is the reason why there are none,
    and ``trimmed`` is true for a user-supplied curve. `write` may write ``files``.
    """

    part: ToolMesh | None = None
    curves: Sequence[ndarray] = ()
    no_curves: str = ""
    trimmed: bool = False
    files: ClassVar[tuple[str, ...]] = (*_PART, *PATTERN)

    @classmethod
    def read(cls, output: Output) -> "DrapeExport":
        """Read the part and the curve that a case names."""
        part, curve = output.part_mesh, output.trim
        if part is None and curve is None:
            return cls()

        mesh = None if part is None else io.read_tool_mesh(part)
        if curve is not None:
            return cls(mesh, [io.read_curve(curve, 3)], trimmed=True)
        try:
            return cls(mesh, mesh.boundary() if mesh else ())
        except MeshError as error:
            return cls(mesh, no_curves=f"{printable(part)}: {error}")

    def write(self, result: Result, axes: Axes, folder: Path) -> dict[str, Any]:
        """Write the exports; returns figures, and the reason for each missing export.

        The result is of a ply on a tool with the given axes.
        """
        if self.part is None and not self.curves:
            return {}
        sheet = Sheet.of_ply(result.ply, result.u, axes)
        figures: dict[str, Any] = {}
        for what, write in (("part", self._fibres), ("pattern", self._pattern)):
            try:
                if not result.converged:
                    raise ValueError(result.not_on_tool or "the run stopped early")
                figures |= write(sheet, folder)
            except ValueError as error:
                figures[what] = f"not written: {error}"
        return figures

    @staticmethod
    def added(summary: Mapping[str, Any], figures: Mapping[str, Any]) -> dict[str, Any]:
        """Summary of a run with the figures of `write`, which are printed too."""
        first = [quantity.declared() for quantity in _FIRST] if figures else []
        return {**summary, **figures, "first": [*summary["first"], *first]}

    def missing(self, figures: Mapping[str, Any]) -> list[str]:
        """Requested exports that `write` has not written, with reasons."""
        requested = ["part"] * (self.part is not None) + ["pattern"] * self.trimmed
        return [f"{what}: {figures[what]}" for what in requested if what in figures]

    def _fibres(self, sheet: Sheet, folder: Path) -> dict[str, Any]:

        if self.part is None:
            return {}
        fibres = fibres_on_tool(sheet, self.part)
        for name in _PART:
            io.write_fibres(folder / name, fibres)
        return {"part_covered_share_of_elements": float(fibres.covered.mean())}

    def _pattern(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        if self.no_curves:
            raise ValueError(self.no_curves)
        if not self.curves:
            return {}
        patterns = [flat_pattern(sheet, curve) for curve in self.curves]
        write_patterns(folder, patterns)
        # Holes have the opposite orientation.
        return {
            "pattern_area_mm2": abs(sum(one.signed_area for one in patterns)),
            "pattern_length_mm": sum(pattern.length for pattern in patterns),
        }
