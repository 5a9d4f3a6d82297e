"""Pictures of the study."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..common.figures import PAGE, colour_of, legend, panels_of
from ..common.tables import Row, grouped, having
from ..study import Picture
from .angle import END, departures, measured, simulated, specimen
from .nylon import measured as nylon_data
from .published import BIAS, CAO, FABRICS, FRAMES, NYLON, error_bars, of_fabric
from .shear import UP_TO
from .tables import array

_BLACK, _GREY = "#202020", "#909090"

_MEASURED = {"color": _BLACK, "marker": ".", "lw": 0}
_LESS_SLACK = {"color": _BLACK, "marker": "o", "mfc": "none", "ms": 3, "lw": 0}

# Text size and width of a picture in inches.
_TEXT, _WIDE = 8, PAGE

#: Colour of predictions by the tests of their law.
_OF_LAW = {FRAMES: 1, BIAS: 0}


# Bands in a legend.
_BANDS: dict[str, dict[str, Any]] = {
    "band of the mean": {"color": _GREY, "alpha": 0.4, "lw": 5},
    "band of a further specimen": {"color": _GREY, "ls": ":"},
}


def _band(axes: Any, rows: list[Row], colour: str, x: str) -> None:
    """Prediction with the band of the mean, and the band of a specimen."""
    at, force = array(rows, x), array(rows, "predicted")
    for half in ("specimen_half", "mean_half"):
        width = array(rows, half) + array(rows, "mesh_half")
        ends = np.maximum(force - width, 1e-6), force + width  # for logarithmic axes
        if half == "mean_half":
            axes.fill_between(at, *ends, color=colour, alpha=0.25, lw=0)
        else:
            axes.plot(at, np.transpose(ends), ":", color=colour, lw=0.9)
    axes.plot(at, force, color=colour, lw=1.2)


def _styles() -> dict[str, dict[str, Any]]:
    return {
        "measured, published error bars": {
            "color": _BLACK,
            "marker": ".",
            "lw": 0,
        },
        **{
            f"law of {name}": {"color": colour_of(_OF_LAW[test])}
            for test, name in (
                (FRAMES, "picture frames"),
                (BIAS, "other bias extensions"),
            )
        },
    }


def bias_extensions(fabric: str, rows: list[Row], file: Path) -> None:
    """Forces of all bias extensions of a fabric, with predictions by both laws."""
    names = [curve.name for curve in of_fabric(fabric, BIAS)]
    columns = 3 if len(names) > 4 else 2
    lines = -(-len(names) // columns)
    bars = error_bars(fabric)
    size = _WIDE, 1.55 * lines + 0.75
    ylabels = ["force (N)"] * lines
    with panels_of(size, file, _TEXT, [""] * columns, ylabels) as (figure, grid):
        for axes in grid.flat[len(names) :]:
            axes.set_axis_off()
        for name, axes in zip(names, grid.flat, strict=False):
            of_name = having(rows, fabric=fabric, test=BIAS, name=name)
            if not of_name:  # in a run of selected cases
                continue
            for law, group in grouped(of_name, "law").items():
                _band(axes, group, colour_of(_OF_LAW[law]), "x")
            x, y = array(group, "x"), array(group, "measured")
            axes.plot(x, y, ".", color=_BLACK, ms=3)
            if name in bars:
                at, force, half = bars[name]
                shown = at <= x[-1]
                axes.errorbar(
                    *(at[shown], force[shown], half[shown]),
                    fmt="none",
                    ecolor=_BLACK,
                    elinewidth=0.7,
                )
            axes.set_yscale("log")
            axes.set_ylim(0.3, 150)
            axes.set_title(name.replace("x", " × ", 1), fontsize=_TEXT)
        for axes in grid.flat[: len(names)][-columns:]:
            axes.set_xlabel("displacement (mm)")
        legend(figure, {**_styles(), **_BANDS}, 3)


def frames(rows: list[Row], file: Path) -> None:
    """Shear forces of all laboratories, with predictions by bias extensions."""
    size = _WIDE, 3.0
    titles = [*FABRICS]
    ylabels = ["shear force per length (N/mm)"]
    with panels_of(
        size, file, _TEXT, titles, ylabels, "shear angle (°)", sharey=True
    ) as (figure, grid):
        styles: dict[str, dict[str, Any]] = {}
        for fabric, axes in zip(FABRICS, grid[0], strict=True):
            of_law = having(rows, fabric=fabric, test=FRAMES)
            if not of_law:  # in a run of selected cases
                continue
            first = next(iter(grouped(of_law, "name").values()))
            _shear_forces(axes, first, of_fabric(fabric, FRAMES))
            for curve in of_fabric(fabric, FRAMES):
                names = ["HKUST", "LMSP", "UML", "UT", "KUL 1st", "KUL 3rd", "UN"]
                style = {"color": colour_of(2 + names.index(curve.name)), "lw": 1.0}
                style |= {} if curve.first_loading else {"ls": "--", "color": _GREY}
                known = curve.x <= UP_TO
                axes.plot(curve.x[known], curve.y[known], **style)
                styles[curve.name] = style
            axes.set_yscale("log")
            axes.set_ylim(1e-3, 1.0)
        predicted = {"color": colour_of(0), "lw": 1.6}
        legend(figure, {"law of bias extensions": predicted, **styles, **_BANDS}, 4)


def _shear_forces(axes: Any, rows: list[Row], curves: Sequence[Any]) -> None:
    """Prediction of a picture frame as a shear force per length."""
    test = next(curve.test for curve in curves if curve.name == rows[0]["name"])
    gamma = np.radians(array(rows, "angle"))
    unit = test.normalised(gamma, np.ones(gamma.size))
    scaled = [
        row
        | {key: row[key] * f for key in ("predicted", "mean_half", "specimen_half")}
        | {"mesh_half": 0.0}
        for row, f in zip(rows, unit, strict=True)
    ]
    _band(axes, scaled, colour_of(0), "angle")


def angle(rows: list[Row], file: Path) -> None:
    """Shear angle against displacement, and the slip index."""
    finest = next(iter(grouped(rows, "density").values()))
    moved, by_test = measured()
    found, size = departures(finest), (_WIDE, 3.3)
    at, slack = array(finest, "displacement"), specimen(None).slack
    with panels_of(size, file, _TEXT, ("", "")) as (figure, grid):
        left, right = grid[0]
        left.plot(at, array(finest, "pin_jointed"), color=_GREY, ls="--")
        left.plot(at, array(finest, "zone"), color=colour_of(0), ls=":")
        left.plot(at, array(finest, "centre"), color=colour_of(0))
        shown = moved <= at[-1] + slack
        degrees = np.degrees(by_test[shown])
        left.plot(moved[shown], degrees, ".", color=_BLACK, ms=3)
        left.plot(
            moved[shown] - slack, degrees, "o", mfc="none", mec=_BLACK, ms=3, mew=0.6
        )
        left.set(xlabel="displacement (mm)", ylabel="shear angle (°)")
        left.set(xlim=(0, None), ylim=(0, None))
        net = array(finest, "pin_jointed")
        right.plot(net, array(finest, "max_slip_index"), color=colour_of(1))
        right.axhline(1.0, color=_GREY, lw=0.8)
        for x, style in ((found.net, "--"), (found.model, "-.")):
            right.axvline(x, color=_BLACK, lw=0.9, ls=style)
        right.set(
            xlabel="shear angle of the inextensible net (°)", ylabel="slip index (-)"
        )
        right.set(xlim=(0, 45), ylim=(0, 4))
        styles: dict[str, dict[str, Any]] = {
            "measured": _MEASURED,
            "measured, less slack": {
                "color": _BLACK,
                "marker": "o",
                "mfc": "none",
                "lw": 0,
            },
            "inextensible net": {"color": _GREY, "ls": "--"},
            "model, zone C": {"color": colour_of(0), "ls": ":"},
            "model, centre": {"color": colour_of(0)},
            "slip index": {"color": colour_of(1)},
            "measured 2° below the net": {"color": _BLACK, "ls": "--", "lw": 0.9},
            "measured 2° below the model": {"color": _BLACK, "ls": "-.", "lw": 0.9},
        }
        legend(figure, styles, 3)


def slip(rows: list[Row], file: Path) -> None:
    """Slip index of the specimen at several shear angles, on the coarser mesh."""
    from skfem_textile import plot

    result = simulated(min(row["density"] for row in rows), 1.0)
    angles = [END * state.load_factor for state in result.states]
    shown = [int(np.argmin(np.abs(np.array(angles) - x))) for x in (20.0, 30.0, 40.0)]
    one_state = [replace(result, states=result.states[: i + 1]) for i in shown]
    titles = [f"{angles[i]:.0f}°" for i in shown]
    plot.field(
        *one_state, field="slip_index", titles=titles, clim=(0, 200), filename=file
    )


def nylon(rows: list[Row], file: Path) -> None:
    """Forces of strips in seven directions."""
    data = nylon_data()
    titles = "fitted", "predicted"
    with panels_of(
        *((_WIDE, 3.1), file, _TEXT, titles, ["force (N)"], "displacement (mm)")
    ) as (figure, grid):
        for which, axes in zip((True, False), grid[0], strict=True):
            groups = grouped(having(rows, fitted=which), "direction").items()
            for i, (direction, group) in enumerate(groups):
                x, force = array(group, "displacement"), array(group, "predicted")
                half, colour = array(group, "mean_half"), colour_of(i)
                axes.fill_between(
                    x, force - half, force + half, color=colour, alpha=0.3, lw=0
                )
                axes.plot(x, force, color=colour, lw=1.2)
                points = data[f"measured_{direction}"][::2]
                axes.plot(data["displacement_mm"][::2], points, ".", color=colour, ms=4)
                axes.annotate(
                    f" {direction}°", (x[-1], force[-1]), va="center", fontsize=_TEXT
                )
            axes.set(xlim=(0, 4.2), ylim=(0, None))
        styles: dict[str, dict[str, Any]] = {
            "measured": _MEASURED,
            "model, with the 95 % band of the laws": {"color": _BLACK},
        }
        legend(figure, styles, 2)


#: Pictures of the predictions by file name.
OF_PREDICTIONS: dict[str, Picture] = {
    **{
        f"{fabric.replace(' ', '_')}.png": partial(bias_extensions, fabric)
        for fabric in FABRICS
    },
    "frames.png": frames,
}

#: Sources, for captions.
SOURCES = CAO, NYLON
