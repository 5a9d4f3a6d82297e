"""The command ``net``: lay a kinematic net on a tool."""

import argparse
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.user_input import printable
from . import words
from .interruption import held
from .output import complain, say
from .page import Row, page, rows, sources
from .progress import log_to_stderr, shown
from .result_folder import ResultFolder

if TYPE_CHECKING:
    from ..drape import FibresInSpace, Net, TriangleMesh, TrimmedNet

# Files of the command.
_FIBRES = ("fibres.vtu", "fibres.csv", "fibres.inp")
_PATTERN = ("pattern.svg", "pattern.csv", "pattern.dxf")
_NET, _PICTURE, _PAGE, _SUMMARY = "net.vtu", "net.png", "net.html", "summary.json"

# Pictures on the page, and their captions.
_CAPTIONS = {
    _PICTURE: "Shear angle of the net on the tool",
    "pattern.svg": "Flat pattern",
}

#: Units of tool files.
UNITS = ("mm", "cm", "m", "in")

# Default length of a cell relative to the diagonal of the tool.
_CELL = 0.01


def add_net(commands: Any) -> None:
    """Add the command to a parser."""
    about = "lay a kinematic net on a tool: shear angles, fibres and flat pattern"
    net = commands.add_parser("net", help=about, description=about)
    add = net.add_argument
    add(
        "--tool",
        nargs="+",
        required=True,
        metavar="FILE",
        help="STL, PLY, OBJ or 3MF files, or other files of triangles",
    )
    add("--unit", choices=UNITS, help="unit of the tool files (default: mm)")
    add("--out", type=Path, required=True, metavar="DIR", help="folder for results")
    add(
        "--fibres",
        type=words.degrees,
        default=0.0,
        metavar="DEG",
        help="angle of the warp to the x axis of the tool file, projected onto the "
        "tool (default: 0); the weft is at right angles",
    )
    add(
        "--point",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="point of the tool in mm at which the first threads cross (default: the "
        "highest point)",
    )
    add(
        "--cell",
        type=words.length,
        metavar="MM",
        help="length of a cell (default: a hundredth of the diagonal of the tool)",
    )
    add(
        "--locking-angle",
        type=words.degrees,
        metavar="DEG",
        help="shear angle of the fabric above which it wrinkles",
    )
    for family in ("warp", "weft"):
        add(
            f"--{family}-along",
            type=Path,
            metavar="FILE.csv",
            help=f"curve that the first {family} thread follows, with the columns x, "
            "y and z (default: a geodesic)",
        )
    add(
        "--trim",
        type=Path,
        nargs="+",
        metavar="FILE.csv",
        help="closed curves along which the pattern is trimmed: the outline, then "
        "holes (default: the edges of the tool)",
    )
    add("--no-render", action="store_true", help="do not draw a picture")


class _Part(NamedTuple):
    """Net on a tool, and its trimmed part, or why there is none."""

    tool: "TriangleMesh"
    net: "Net"
    trimmed: "TrimmedNet | None"
    no_pattern: str

    @property
    def angle_deg(self) -> ndarray:
        """Sizes of shear angles of the part, or else of all cells, NaN elsewhere."""
        of = self.net if self.trimmed is None else self.trimmed
        return np.degrees(np.abs(of.shear_angle()))

    @property
    def areas(self) -> ndarray:
        """Areas of the cells on the tool in mm², 0 outside the part."""
        areas = np.nan_to_num(self.net.areas())
        return areas if self.trimmed is None else areas * self.trimmed.shares


def run_net(options: argparse.Namespace) -> int:
    """Lay a net on a tool and write its results; returns the exit code.

    Raises
    ------
    ValueError
        If a file is refused, or the net cannot start.
    OSError, OutputError
        If the folder cannot be written.
    """
    from .. import io

    began = perf_counter()
    log_to_stderr(0)
    with shown("laying the net"):
        part = _laid(options)
        fibres = _fibres(part)
    figures = _figures(part, options)
    out = ResultFolder(
        options.out, (_SUMMARY, _NET, *_FIBRES, *_PATTERN, _PICTURE, _PAGE)
    )
    verdict = list(_verdict(part, options))
    with held(), out as folder:
        for name in _FIBRES:
            io.write_fibres(folder / name, fibres)
        io.write_net(folder / _NET, part.net)
        if part.trimmed:
            for name in _PATTERN:
                if not name.endswith("dxf") or find_spec("ezdxf"):
                    io.write_pattern(folder / name, part.trimmed.pattern)
        if not options.no_render:
            _draw(part, options, folder)
        figures["time_s"] = perf_counter() - began
        io.write_summary(figures, folder / _SUMMARY)
        (folder / _PAGE).write_text(
            page(
                _PAGE,
                title=f"Net on {printable(Path(options.tool[0]).name)}",
                verdict=verdict,
                figures=rows(figures),
                pictures=sources(folder, _CAPTIONS),
            ),
            encoding="utf-8",
        )
    for name, _, text in verdict:
        say(f"{name:24}{text}")
    say(f"results written to {printable(options.out)}: open {_PAGE}")
    return 0


def _laid(options: argparse.Namespace) -> _Part:
    """Read the tool, lay the net and trim its pattern."""
    from .. import drape, io
    from ..scenes.drape import contact_point

    tool = io.read_surface(options.tool, options.unit)
    given = options.trim and [io.read_curve(file, 3) for file in options.trim]
    along = [
        file and io.read_curve(file)
        for file in (options.warp_along, options.weft_along)
    ]
    start = contact_point(tool, options.point)
    axes = drape.Axes.at(tool, start)
    warp = np.radians(options.fibres)
    size = float(np.linalg.norm(np.ptp(tool.facets.points, axis=1)))
    net = drape.net(
        tool,
        options.cell or _CELL * size,
        angles=(warp, warp + np.pi / 2),
        point=start,
        first=axes.turn[:, 0],
        warp_along=along[0],
        weft_along=along[1],
    )
    try:
        outline, *holes = given or tool.facets.boundary()
        return _Part(tool, net, drape.trimmed(net, outline, holes), "")
    except ValueError as error:
        return _Part(tool, net, None, str(error))


def _fibres(part: _Part) -> "FibresInSpace":
    """Fibres in the triangles of the tool."""
    from ..drape import Sheet, fibres_on_tool

    return fibres_on_tool(Sheet.of_net(part.net), part.tool.facets)


def _figures(part: _Part, options: argparse.Namespace) -> dict[str, Any]:
    """Figures of the summary."""
    net, angle, areas = part.net, part.angle_deg, part.areas
    i, j = np.unravel_index(np.nanargmax(angle), angle.shape)
    worst = net.positions[:, i : i + 2, j : j + 2].mean(axis=(1, 2))
    figures: dict[str, Any] = {
        "tool": ", ".join(options.tool),
        "fibres_deg": options.fibres,
        "cell_mm": net.cell,
        "n_cells": int(net.cells.sum()),
        **_xyz("start", net.positions[:, *net.start]),
        "max_shear_angle_deg": float(np.nanmax(angle)),
        **_xyz("max_shear_angle", worst),
        "mean_shear_angle_deg": float(np.average(np.nan_to_num(angle), weights=areas)),
        "area_of_tool_mm2": part.tool.facets.area,
        "area_of_part_mm2": float(areas.sum()),
    }
    if options.locking_angle is not None:
        figures["locking_angle_deg"] = options.locking_angle
        locked = angle > options.locking_angle
        figures["area_above_locking_angle_mm2"] = float(areas[locked].sum())
    if part.trimmed:
        figures["pattern_area_mm2"] = part.trimmed.pattern.area
        figures["pattern_length_mm"] = part.trimmed.pattern.length
    else:
        figures["pattern"] = f"not written: {part.no_pattern}"
    return figures


def _xyz(what: str, point: ndarray) -> dict[str, float]:
    return {
        f"{what}_at_{axis}_mm": x for axis, x in zip("xyz", point.tolist(), strict=True)
    }


def _verdict(part: _Part, options: argparse.Namespace) -> Iterator[Row]:
    """Rows: whether the net is whole, the shear within the limit, the pattern cut."""
    net = part.net
    if net.folds.size:
        yield "Net", "bad", f"folds at {_places(net.folds)}: threads lie on one another"
    elif net.leaves.size:
        yield "Net", "bad", f"leaves the tool at {_places(net.leaves)}"
    else:
        yield "Net", "good", "reaches all edges of the tool without folding"
    angle = float(np.nanmax(part.angle_deg))
    largest, limit = f"at most {angle:.1f}°", options.locking_angle
    if limit is None:
        yield "Shear angle", "", f"{largest}; no locking angle is given"
    else:
        good = angle <= limit
        word = "within" if good else "above"
        text = f"{largest}, {word} the locking angle of {limit:g}°"
        yield "Shear angle", "good" if good else "bad", text
    if part.trimmed:
        pattern = part.trimmed.pattern
        text = f"{pattern.area:.0f} mm² of fabric, {pattern.length:.0f} mm to cut"
        yield "Flat pattern", "good", text
    else:
        yield "Flat pattern", "bad", part.no_pattern


def _places(points: ndarray) -> str:
    """First of some points, and their number."""
    x = ", ".join(f"{c:.4g}" for c in points[:, 0])
    more = points.shape[1] - 1
    return f"({x}) mm" + (f" and {more} other places" if more else "")


def _draw(part: _Part, options: argparse.Namespace, folder: Path) -> None:
    """Draw the picture, or print the reason why not."""
    try:
        from ..plot import net_on_tool

        limit = options.locking_angle
        net_on_tool(
            part.net,
            part.tool,
            None if limit is None else float(np.radians(limit)),
            filename=folder / _PICTURE,
        )
    except Exception as error:
        complain(f"the picture was not drawn: {printable(error)}")
