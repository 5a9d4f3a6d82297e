"""Figures of fits: recordings, laws with their bands, residuals and predictions."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import cycle
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy import ndarray

from ..fabric import Linear
from ..plot.curves import COLOURS
from ..plot.drawing import picture_path, save
from .bending import BendingCurve
from .choice import Test, largest_argument
from .cycles import displacement, force_of
from .fitting import FabricFit
from .measured import FAMILIES, families_of
from .validation import NORMAL_95, Validation

#: Function that draws the content of axes.
Panel: TypeAlias = Callable[[Axes], None]

_T = TypeVar("_T")

# Number of points of a line.
_N = 201

# Largest force and angle of the points shown, relative to the fitted ones.
_MOST = 1.6

_STYLE = {"axes.spines.top": False, "axes.spines.right": False, "font.size": 10}

# Width and height of a panel in inches.
_SIZE = 4.8, 4.0

_SHEAR_ANGLE = "shear angle (°)"
_CURVATURE, _MOMENT = "curvature κ (1/mm)", "bending moment M (N·mm/mm)"

# Axis labels of the columns of a recording, and factors from their units.
_LABELS = {
    "displacement": ("displacement (mm)", 1.0),
    "shear angle": (_SHEAR_ANGLE, np.degrees(1.0)),
    "chord angle": ("chord angle (°)", np.degrees(1.0)),
    "overhang": ("overhang (mm)", 1.0),
    "strain": ("strain (-)", 1.0),
    "warp strain": ("warp strain (-)", 1.0),
    "weft strain": ("weft strain (-)", 1.0),
    "curvature": (_CURVATURE, 1.0),
    "bending moment": (_MOMENT, 1.0),
}


def draw(result: FabricFit, filename: str | os.PathLike[str]) -> None:
    """Draw the test curves and the fitted laws with their bands, two panels in a row.

    Parameters
    ----------
    result
        The fit.
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).
    """
    path = picture_path(filename)
    save_panels(
        [x for part in result.parts for x in law_panels(result, part).values()], path
    )


def draw_panels(panels: Mapping[str, Panel], folder: Path) -> dict[str, str]:
    """Draw each panel into a separate PNG; returns captions by file name.

    Parameters
    ----------
    panels
        Panels by caption.
    folder
        Existing folder.
    """
    captions = {f"{i}.png": caption for i, caption in enumerate(panels)}
    for name, panel in zip(captions, panels.values(), strict=True):
        save_panels([panel], folder / name)
    return captions


def save_panels(panels: list[Panel], path: Path) -> None:
    """Write a picture with two panels in a row."""
    columns = min(len(panels), 2)
    rows = -(-len(panels) // columns)
    width, height = _SIZE
    with mpl.rc_context(_STYLE):
        size = width * columns, height * rows
        figure = Figure(figsize=size, layout="constrained")
        for i, panel in enumerate(panels, start=1):
            axes = figure.add_subplot(rows, columns, i)
            panel(axes)
            axes.grid(alpha=0.3)
            if axes.get_legend_handles_labels()[0]:
                axes.legend(frameon=False)
        save(figure, path)


def data_panel(test: Test) -> Panel | None:
    """Recording as read, with rows left out; None if the test was not read."""
    prepared = test.prepared
    if prepared is None or prepared.driving not in prepared.read.columns:
        return None
    read = prepared.read
    label, unit = _LABELS[prepared.driving]
    x = unit * read.columns[prepared.driving]
    wrong = np.isin(read.rows, prepared.outliers)
    used = np.isin(read.rows, prepared.recording.rows) & ~wrong

    def panel(axes: Axes) -> None:
        for colour, name in _coloured(prepared.forces):
            y = read.columns[name]
            kinds = (
                (used, ".", colour, name),
                (~used & ~wrong, ".", "#b0b0b0", "not used"),
                (wrong, "x", "#a63c00", "outlier"),
            )
            for rows, mark, of_kind, kind in kinds:
                if rows.any():
                    axes.plot(x[rows], y[rows], mark, ms=4, color=of_kind, label=kind)
        of = _LABELS.get(prepared.forces[0], ("force (N)", 1.0))
        axes.set(xlabel=label, ylabel=of[0])

    return panel


def law_panels(result: FabricFit, part: str) -> dict[str, Panel]:
    """Test curves of a part, and its law with its band, by caption.

    Forces of a law with friction are without it, except in a panel of its loops.
    """
    panels = _elastic_panels(result, part)
    if part in result.friction:
        loops = {"Loops of loading and unloading, with friction": _loops(result, part)}
        panels = loops | {f"{k}; without friction": x for k, x in panels.items()}
    return panels


def _loops(result: FabricFit, part: str) -> Panel:
    """Measured loops of each test, and loops of the law."""

    def panel(axes: Axes) -> None:
        for colour, (test, force) in _coloured(result.loops(part)):
            moved = displacement(test)
            axes.plot(moved, force_of(test), ".", ms=4, color=colour, label=test.name)
            axes.plot(moved, force, color="black", lw=0.8)
        labels = "displacement (mm)", "force (N)"
        if part.startswith("bending"):
            labels = _CURVATURE, _MOMENT
        axes.set(xlabel=labels[0], ylabel=labels[1])

    return panel


def _elastic_panels(result: FabricFit, part: str) -> dict[str, Panel]:
    if part == "shear":
        return {
            "Force of the shear tests; crosses are not fitted": _forces(result),
            "Shear moment, point by point and of the law": _moments(result),
        }
    if part.startswith("bending"):
        panels: dict[str, Panel] = {}
        if result.cantilevers(part):
            panels = {
                "Overhang of the cantilevers": _overhangs(result, part),
                "Bending stiffness of each reading": _stiffnesses(result, part),
            }
        if len(result.tests_of(part)) > len(result.cantilevers(part)) or not isinstance(
            result.parts[part].law, Linear
        ):
            panels["Bending moment of the law"] = _bending_moments(result, part)
        return panels
    return {
        f"Tension of the {FAMILIES[i]}": _tension_panel(result, part, i)
        for i in families_of(part)
    }


def residual_panel(result: FabricFit, part: str) -> Panel:
    """Residuals of the curves of a part relative to their noise."""
    fit = result.parts[part]

    def panel(axes: Axes) -> None:
        axes.axhspan(-NORMAL_95, NORMAL_95, color="#808080", alpha=0.15, lw=0)
        axes.axhline(0.0, color="#808080", lw=1.0)
        for i, (colour, test) in enumerate(_coloured(result.tests_of(part))):
            label, scaled = test.name, fit.residuals[i] / fit.noise[i]
            for xlabel, x, y in _along(result, part, test, scaled):
                axes.plot(x, y, ".", color=colour, ms=4, label=label)
                axes.set(xlabel=xlabel, ylabel="residual / noise (-)")
                label = ""
        axes.locator_params(axis="x", nbins=5)

    return panel


def _along(
    result: FabricFit, part: str, test: Any, values: ndarray
) -> Iterator[tuple[str, ndarray, ndarray]]:
    """Values of a curve over the argument of its law: label, abscissa, ordinate."""
    if part == "shear":
        used = test.used(result.choice.up_to)
        angle = result.zeroed(result.specimens.index(test)).angle[used]
        yield _SHEAR_ANGLE, np.degrees(angle), values
    elif isinstance(test, BendingCurve):
        yield _CURVATURE, test.curvature, values
    elif part.startswith("bending"):
        yield "chord angle (°)", np.degrees(test.angle), values
    else:
        families, taut = families_of(part), test.with_slack(result.zeros_of(test))
        each = np.split(values, len(families), axis=-1)
        for i, own in zip(families, each, strict=True):
            yield "strain ln λ (-)", taut.along(i).strain, own


def prediction_panel(one: Validation) -> Panel:
    """Prediction with its bands, and the measured curve with the one of its noise."""
    x, prediction = one.displacement, one.prediction
    force, law = prediction.force, prediction.pointwise
    both = law + np.nan_to_num(prediction.discretisation)
    noise = NORMAL_95 * one.noise
    further = np.maximum(law, one.scatter)
    bands = [(both, 0.2, "parameters and discretisation"), (law, 0.35, "parameters")]
    if one.scatter.any():
        bands.insert(0, (further, 0.12, "a specimen"))

    def panel(axes: Axes) -> None:
        for half, alpha, label in bands:
            band = force - half, force + half
            _fill(axes, x, band, COLOURS[0], alpha, f"{label}, 95 %")
        measured = one.measured - noise, one.measured + noise
        _fill(axes, x, measured, COLOURS[1], 0.2, "noise, 95 %")
        axes.plot(x, force, color=COLOURS[0], label="prediction")
        axes.plot(x, one.measured, ".", color=COLOURS[1], label=one.specimen.name)
        axes.plot(x, force + one.off.force, color=COLOURS[1], label="its smooth curve")
        axes.set(xlabel="displacement (mm)", ylabel="force (N)")

    return panel


def _coloured(items: Iterable[_T], first: int = 0) -> Iterator[tuple[str, _T]]:
    """Items, each with its colour, from the first one on."""
    return zip(cycle(COLOURS[first:]), items, strict=False)


def _fill(
    axes: Axes, x: ndarray, band: Any, colour: str, alpha: float, label: str = ""
) -> None:
    """Fill a band, its lower and upper ends."""
    low, high = band
    axes.fill_between(x, low, high, color=colour, alpha=alpha, lw=0, label=label)


def _forces(result: FabricFit) -> Panel:
    """Forces of the shear tests, and of the law.

    Excluded points far beyond the fitted ones, which would hide these, are not drawn.
    """
    fit, up_to = result.parts["shear"], result.choice.up_to
    most = _MOST * max(float(s.force[s.used(up_to)].max()) for s in result.specimens)
    widest = _MOST * float(np.degrees(result.largest_angle))

    def panel(axes: Axes) -> None:
        for i, (colour, specimen) in enumerate(_coloured(result.specimens, 1)):
            used = specimen.used(up_to)
            angle, force = np.degrees(result.zeroed(i).angle), specimen.force
            order = np.argsort(angle[used])
            beside = ~used & (force <= most) & (angle <= widest)
            axes.plot(angle[used], force[used], ".", color=colour, label=specimen.name)
            axes.plot(angle[beside], force[beside], "x", color=colour, ms=3)
            curves = np.array([*fit.curve_band(i), fit.predicted(i)])
            low, high, law = curves[:, order]
            x = angle[used][order]
            _fill(axes, x, (low, high), colour, 0.15)
            axes.plot(x, law, color=colour)
        axes.set(xlabel=_SHEAR_ANGLE, ylabel="force (N)")

    return panel


def _moments(result: FabricFit) -> Panel:
    """Moments of the shear tests, and of the law with its band."""
    fit, up_to = result.parts["shear"], result.choice.up_to
    gamma = np.linspace(0.0, result.largest_angle, _N)
    degrees = np.degrees(gamma)

    def value(law: Any) -> ndarray:
        return law.value(gamma)

    def panel(axes: Axes) -> None:
        for i, (colour, _) in enumerate(_coloured(result.specimens, 1)):
            at, C = result.zeroed(i).pointwise(up_to)
            axes.plot(np.degrees(at), C, ".", color=colour, ms=3)
        band = fit.band(value)
        _fill(axes, degrees, band, COLOURS[0], 0.3)
        axes.plot(degrees, value(fit.law), color=COLOURS[0], label="law, 95 %")
        if (scatter := fit.scatter(value)) is not None:
            _fill(axes, degrees, scatter, COLOURS[0], 0.12, "a specimen")
        holds = min(np.degrees(s.kinematics_limit) for s in result.specimens)
        if holds <= _MOST * degrees[-1]:
            axes.axvline(holds, color="grey", ls=":", label="end of the kinematics")
        axes.set(xlabel=_SHEAR_ANGLE, ylabel="shear moment C (N·mm/mm²)")
        most = 1.3 * float(value(fit.law).max())
        axes.set_ylim(min(0.0, 1.1 * float(band.min())), most)

    return panel


def _tension_panel(result: FabricFit, part: str, family: int) -> Panel:
    """Tensions of a family over its strains, and the law with its band."""
    fit = result.parts[part]

    def panel(axes: Axes) -> None:
        for k, (colour, (test, families)) in enumerate(_coloured(result.along(part))):
            along = test.along(family)
            assert along is not None
            curves = np.array([*fit.curve_band(k), fit.predicted(k)])
            own = np.split(curves, len(families), axis=1)[families.index(family)]
            order = np.argsort(along.strain)
            x, scale = along.strain[order], np.exp(along.strain) / along.width
            low, high, law = (own * scale)[:, order]
            axes.plot(x, along.tension[order], ".", color=colour, label=test.name)
            _fill(axes, x, (low, high), colour, 0.15)
            axes.plot(x, law, color=colour)
        axes.locator_params(axis="x", nbins=5)
        name = FAMILIES[family]
        axes.set(xlabel=f"{name} strain ln λ (-)", ylabel=f"{name} tension (N/mm)")

    return panel


def _overhangs(result: FabricFit, part: str) -> Panel:
    """Readings over the angle."""

    def panel(axes: Axes) -> None:
        for colour, test in _coloured(result.cantilevers(part)):
            degrees = np.degrees(test.angle)
            axes.plot(degrees, test.overhang, "o", color=colour, label=test.name)
        axes.set(xlabel="chord angle (°)", ylabel="overhang (mm)")

    return panel


def _stiffnesses(result: FabricFit, part: str) -> Panel:
    """Bending stiffness of each reading, and the result with its band."""
    fit = result.parts[part]

    def panel(axes: Axes) -> None:
        for colour, test in _coloured(result.cantilevers(part)):
            degrees = np.degrees(test.angle)
            axes.plot(degrees, test.by_elastica, "o", color=colour, label=test.name)
            axes.plot(degrees, test.by_peirce, "x", color=colour)
        if isinstance(fit.law, Linear):
            axes.axhspan(*fit.intervals[0], color="#808080", alpha=0.15, lw=0)
            axes.axhline(float(fit.values[0]), color="#808080", lw=1.0)
        else:
            for test in result.cantilevers(part):
                degrees, of_law = np.degrees(test.angle), test.apparent(fit.law)
                axes.plot(degrees, of_law, "_", color="#808080", ms=12)
        label = "bending stiffness (N·mm)\no elastica, x Peirce"
        axes.set(xlabel="chord angle (°)", ylabel=label)

    return panel


def _bending_moments(result: FabricFit, part: str) -> Panel:
    """Measured moments, and the law with its band."""
    fit, tests = result.parts[part], result.tests_of(part)
    end = largest_argument(result.tests, part, None)
    curves = [one for one in tests if isinstance(one, BendingCurve)]
    low = min([0.0, *(float(one.curvature.min()) for one in curves)])
    x = np.linspace(low, end, _N)

    def panel(axes: Axes) -> None:
        for colour, test in _coloured(curves, 1):
            axes.plot(test.curvature, test.moment, ".", color=colour, label=test.name)
        _fill(axes, x, fit.band(lambda law: law.value(x)), COLOURS[0], 0.3)
        axes.plot(x, fit.law.value(x), color=COLOURS[0], label="law, 95 %")
        axes.locator_params(axis="x", nbins=5)
        axes.set(xlabel=_CURVATURE, ylabel=_MOMENT)

    return panel
