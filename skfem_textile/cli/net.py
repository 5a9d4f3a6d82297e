"""The command ``net``: lay a kinematic net on a tool."""

import argparse
from collections.abc import Sequence
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
from .progress import STOPPED_EARLY, log_to_stderr, shown
from .result_folder import ResultFolder
from .results import PATTERN, write_patterns

if TYPE_CHECKING:
    from ..drape import (
        BestStart,
        Dart,
        FibresInSpace,
        FlatPattern,
        Net,
        TriangleMesh,
    )

# Files of the command.
_FIBRES = ("fibres.vtu", "fibres.csv", "fibres.inp")
_NET, _PICTURE, _STARTS = "net.vtu", "net.png", "starts.png"
_PAGE, _SUMMARY = "net.html", "summary.json"

# Least length of a cell in the search for the best start, relative to the diagonal:
# about forty cells along either side of the part.
_SEARCHED = 0.018

# Smallest and largest length of a cell, relative to the diagonal of the tool.  Chosen:
# half a million cells take a minute; the area of a pattern of coarser cells is wrong by
# more than a percent.
_FINEST, _COARSEST = 1e-3, 0.06

# Share of a cell inside the part above which its shear counts.
_HALF = 0.5

# Pictures on the page, and their captions.
_CAPTIONS = {
    _PICTURE: "Shear angle of the net on the tool",
    _STARTS: "Starts that were compared, with the shear of their nets over the part",
    "pattern.svg": "Flat pattern",
}

#: Units of tool files.
UNITS = ("mm", "cm", "m", "in")

_EXIT_CODES = (
    "exit code: 0 if there is a flat pattern; 1 if there is none, because the net does "
    "not cover the part (all other results are written); 2 for invalid input; 130 if "
    "interrupted"
)

# Default length of a cell relative to the diagonal of the tool.
_CELL = 0.01


def add_net(commands: Any) -> None:
    """Add the command to a parser."""
    about = "lay a kinematic net on a tool: shear angles, fibres and flat pattern"
    net = commands.add_parser("net", help=about, description=about, epilog=_EXIT_CODES)
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
        "highest point, or a point near the middle)",
    )
    add(
        "--cell",
        type=words.length,
        metavar="MM",
        help="length of a cell (default: a hundredth of the diagonal of the tool)",
    )
    add(
        "--locking-angle",
        type=words.acute_degrees,
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
    add(
        "--best",
        choices=("largest", "mean"),
        help="search for the point and the direction with the smallest largest, or "
        "mean, shear angle over the part",
    )
    add(
        "--darts",
        action="store_true",
        help="cut darts where the net folds or shears beyond the locking angle",
    )
    add(
        "--roll-width",
        type=words.length,
        metavar="MM",
        help="cover the tool with courses of this width, side by side",
    )
    add(
        "--overlap",
        type=float,
        default=0.0,
        metavar="MM",
        help="overlap of neighbouring courses (default: 0)",
    )
    add("--no-render", action="store_true", help="do not draw a picture")


class _Part(NamedTuple):
    """Nets on a tool, their flat pattern, or why there is none, and the search.

    Courses have one pattern for each net.
    """

    tool: "TriangleMesh"
    pieces: "Sequence[tuple[Net, ndarray]]"
    patterns: "Sequence[FlatPattern]" = ()
    darts: "Sequence[Dart]" = ()
    no_pattern: str = ""
    search: "BestStart | None" = None


class _Cells(NamedTuple):
    """Cells of the part, or of the whole net without a pattern.

    ``pieces`` are nets with masks of the cells of which at least half is in the part;
    sizes of their shear angles in degrees, areas on the tool in mm², and centres.
    ``area`` is the area of the part.
    """

    pieces: "list[tuple[Net, ndarray]]"
    angles: ndarray
    areas: ndarray
    centres: ndarray
    area: float

    @classmethod
    def of(cls, part: _Part) -> "_Cells":
        from ..drape.trimming import shares_inside

        pieces, angles, areas, centres, whole = [], [], [], [], 0.0
        for k, (net, mask) in enumerate(part.pieces):
            shares = mask
            if part.patterns:
                one = part.patterns[min(k, len(part.patterns) - 1)]
                shares = shares_inside(net, one)
            inside = mask & (shares >= _HALF)
            whole += float((np.nan_to_num(net.areas()) * shares * mask).sum())
            x = net.positions
            middle = 0.25 * (
                x[:, 1:, 1:] + x[:, 1:, :-1] + x[:, :-1, 1:] + x[:, :-1, :-1]
            )
            pieces.append((net, inside))
            angles.append(np.degrees(np.abs(net.shear_angle()[inside])))
            areas.append((net.areas() * shares)[inside])
            centres.append(middle[:, inside])
        if not any(one.size for one in angles):
            raise ValueError("the net has no cell on the tool: use smaller cells")
        numbers = np.concatenate(angles), np.concatenate(areas), np.hstack(centres)
        return cls(pieces, *numbers, whole)


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

    _refuse_combinations(options)
    began = perf_counter()
    log_to_stderr(0)
    with shown("laying the net"):
        part = _laid(options)
        fibres = _fibres(part)
        cells = _Cells.of(part)
    figures, verdict = _figures(part, cells, options), _verdict(part, cells, options)
    out = ResultFolder(
        options.out, (_SUMMARY, _NET, *_FIBRES, *PATTERN, _PICTURE, _STARTS, _PAGE)
    )
    with held(), out as folder:
        for name in _FIBRES:
            io.write_fibres(folder / name, fibres)
        io.write_net(folder / _NET, cells)
        if part.patterns:
            write_patterns(folder, _to_cut(part))
        if not options.no_render:
            _draw(part, cells, options, folder)
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
    return 0 if part.patterns else STOPPED_EARLY


def _refuse_combinations(options: argparse.Namespace) -> None:
    """Refuse options that contradict each other."""
    if options.darts and options.locking_angle is None:
        raise ValueError("--darts requires --locking-angle")
    if options.darts and options.roll_width is not None:
        raise ValueError("--darts cannot be combined with --roll-width")
    if options.overlap and options.roll_width is None:
        raise ValueError("--overlap requires --roll-width")
    fixed = [
        f"--{name.replace('_', '-')}"
        for name in ("point", "warp_along", "weft_along")
        if getattr(options, name) is not None
    ]
    if options.fibres:
        fixed.append("--fibres")
    if options.best and fixed:
        raise ValueError(f"--best cannot be combined with {' and '.join(fixed)}")


def _laid(options: argparse.Namespace) -> _Part:
    """Read the tool, lay the net and trim its pattern."""
    from .. import drape, io

    tool = io.read_surface(options.tool, options.unit)
    given = options.trim and [io.read_curve(file, 3) for file in options.trim]
    along = [
        file and io.read_curve(file)
        for file in (options.warp_along, options.weft_along)
    ]
    warp = np.radians(options.fibres)
    angles = warp, warp + np.pi / 2
    size = float(np.linalg.norm(np.ptp(tool.facets.points, axis=1)))
    cell = options.cell or _CELL * size
    if not _FINEST <= cell / size <= _COARSEST:
        raise ValueError(
            f"the length of a cell must be between {_FINEST * size:.3g} and "
            f"{_COARSEST * size:.3g} mm on a tool with a diagonal of {size:.4g} mm, "
            f"got {cell:g} mm"
        )
    loops = tool.facets.boundary()
    outline, *holes = given or loops
    spanned = tool.without_holes() if len(loops) > 1 else tool
    search = None
    if options.best:
        points = drape.points_of_part(spanned, outline, holes)
        of_part = float(np.linalg.norm(np.ptp(points, axis=1)))
        search = drape.best_start(
            spanned,
            max(cell, _SEARCHED * of_part),
            angles=angles,
            points=points,
            measure=options.best,
        )
        start = search.start
    else:
        point = _start(tool, options.point)
        start = drape.NetStart(point, drape.Axes.at(tool, point).turn[:, 0])
    settings: dict[str, Any] = {
        **start._asdict(),
        "angles": angles,
        "warp_along": along[0],
        "weft_along": along[1],
    }
    part = _pieces(options, tool, spanned, cell, outline, holes, settings)
    return part._replace(search=search)


def _pieces(
    options: argparse.Namespace,
    tool: "TriangleMesh",
    spanned: "TriangleMesh",
    cell: float,
    outline: ndarray,
    holes: "Sequence[ndarray]",
    settings: dict[str, Any],
) -> _Part:
    """Lay courses, a net with darts, or a net, and trim the pattern."""
    from .. import drape

    if options.roll_width is not None:
        strips = drape.courses(
            spanned, cell, options.roll_width, options.overlap, **settings
        )
        pieces = [piece for strip in strips for piece in strip.pieces]
        return _Part(tool, pieces, [strip.pattern for strip in strips])
    if options.darts:
        limit = float(np.radians(options.locking_angle))
        cut = drape.net_with_darts(spanned, cell, limit, **settings)
        try:
            found = drape.pattern_with_darts(cut, outline, holes=holes)
            return _Part(tool, cut.pieces, [found.pattern], found.darts)
        except ValueError as error:
            return _Part(tool, cut.pieces, no_pattern=str(error))
    net = drape.net(spanned, cell, **settings)
    try:
        pattern = drape.flat_pattern(drape.Sheet.of_net(net), outline, holes=holes)
        return _Part(tool, net.pieces, [pattern])
    except ValueError as error:
        return _Part(tool, net.pieces, no_pattern=str(error))


def _start(tool: "TriangleMesh", point: "Sequence[float] | None") -> ndarray:
    """Given point of a tool, else the highest, or one near its middle."""
    from ..scenes.drape import contact_point

    try:
        return contact_point(tool, point)
    except ValueError:
        if point is not None:
            raise
    centres, areas = tool.facets.centres(), tool.facets.areas()
    middle = np.average(centres, axis=1, weights=areas)
    near = np.linalg.norm(centres - middle[:, None], axis=0).argmin()
    return contact_point(tool, centres[:, near].tolist())


def _to_cut(part: _Part) -> "Sequence[FlatPattern]":
    """Patterns in one plane; courses side by side."""
    from ..drape import side_by_side

    return part.patterns if len(part.patterns) == 1 else side_by_side(part.patterns)


def _fibres(part: _Part) -> "FibresInSpace":
    """Fibres in the triangles of the tool."""
    from ..drape import Sheet, fibres_on_tool

    return fibres_on_tool(Sheet.of_net(part), part.tool.facets)


def _figures(part: _Part, cells: _Cells, options: argparse.Namespace) -> dict[str, Any]:
    """Figures of the summary."""
    (net, _), worst = part.pieces[0], cells.angles.argmax()
    figures: dict[str, Any] = {
        "tool": ", ".join(options.tool),
        "fibres_deg": _warp_deg(part.tool, net),
        "cell_mm": net.cell,
        "n_cells": int(cells.angles.size),
        **_xyz("start", net.positions[:, *net.start]),
        "max_shear_angle_deg": float(cells.angles[worst]),
        **_xyz("max_shear_angle", cells.centres[:, worst]),
        "mean_shear_angle_deg": float(np.average(cells.angles, weights=cells.areas)),
        "area_of_tool_mm2": part.tool.facets.area,
    }
    covered = "part" if options.roll_width is None else "courses"
    figures[f"area_of_{covered}_mm2"] = cells.area
    if options.locking_angle is not None:
        figures["locking_angle_deg"] = options.locking_angle
        locked = cells.angles > options.locking_angle
        figures["area_above_locking_angle_mm2"] = float(cells.areas[locked].sum())
    if part.patterns:
        figures["pattern_area_mm2"] = sum(one.area for one in part.patterns)
        figures["pattern_length_mm"] = sum(one.length for one in part.patterns)
    else:
        figures["pattern"] = f"not written: {part.no_pattern}"
    if options.roll_width is not None:
        figures["courses"] = len(part.patterns)
    if options.darts:
        if part.patterns:
            figures["darts"] = len(part.darts)
        figures["dart_areas_mm2"] = [dart.area for dart in part.darts]
        figures["dart_lengths_mm"] = [list(dart.lengths) for dart in part.darts]
    return figures


def _warp_deg(tool: "TriangleMesh", net: "Net") -> float:
    """Angle of the first warp thread to the x axis of the tool at the start."""
    from ..drape import Axes

    i, j = net.start
    x = net.positions
    ahead = x[:, min(i + 1, x.shape[1] - 1), j] - x[:, max(i - 1, 0), j]
    along, across = Axes.at(tool, x[:, i, j]).turn[:, :2].T @ ahead
    return round(float(np.degrees(np.arctan2(across, along))), 9)


def _xyz(what: str, point: ndarray) -> dict[str, float]:
    return {
        f"{what}_at_{axis}_mm": x for axis, x in zip("xyz", point.tolist(), strict=True)
    }


def _verdict(part: _Part, cells: _Cells, options: argparse.Namespace) -> list[Row]:
    """Rows: whether the net is whole, the shear within the limit, the pattern cut."""
    folds, leaves = (
        np.hstack([getattr(net, what) for net, _ in part.pieces])
        for what in ("folds", "leaves")
    )
    verdict: list[Row] = []
    if part.patterns and options.roll_width is None:
        text = "covers the part without folding"
        verdict.append(("Net", "good", text))
    elif folds.size:
        text = f"folds at {_places(folds)}: threads lie on one another"
        verdict.append(("Net", "bad", text))
    elif leaves.size:
        verdict.append(("Net", "bad", f"leaves the tool at {_places(leaves)}"))
    elif part.patterns:
        verdict.append(("Net", "good", "the courses cover the tool without folding"))
    else:
        verdict.append(("Net", "bad", "does not cover the part"))
    largest, limit = f"at most {cells.angles.max():.1f}°", options.locking_angle
    if limit is None:
        text = f"{largest}; no locking angle is given"
        verdict.append(("Shear angle", "", text))
    else:
        good = cells.angles.max() <= limit
        word = "within" if good else "above"
        text = f"{largest}, {word} the locking angle of {limit:g}°"
        verdict.append(("Shear angle", "good" if good else "bad", text))
    if part.darts:
        areas = ", ".join(f"{dart.area:.0f}" for dart in part.darts)
        verdict.append(("Darts", "", f"{len(part.darts)}, of {areas} mm²"))
    if options.roll_width is not None:
        text = f"{len(part.patterns)}, each {options.roll_width:g} mm wide"
        verdict.append(("Courses", "", text))
    if part.patterns:
        area, length = (
            sum(getattr(one, what) for one in part.patterns)
            for what in ("area", "length")
        )
        text = f"{area:.0f} mm² of fabric, {length:.0f} mm to cut"
        verdict.append(("Flat pattern", "good", text))
    else:
        verdict.append(("Flat pattern", "bad", part.no_pattern))
    return verdict


def _places(points: ndarray) -> str:
    """First of some points, and their number."""
    x = ", ".join(f"{c:.4g}" for c in points[:, 0])
    more = points.shape[1] - 1
    return f"({x}) mm" + (f" and {more} other places" if more else "")


def _draw(
    part: _Part, cells: _Cells, options: argparse.Namespace, folder: Path
) -> None:
    """Draw the pictures, or print the reason why not."""
    try:
        from ..plot import net_on_tool, starts

        limit = options.locking_angle
        net_on_tool(
            cells,
            part.tool,
            None if limit is None else float(np.radians(limit)),
            filename=folder / _PICTURE,
        )
        if part.search is not None:
            starts(part.search, part.tool, filename=folder / _STARTS)
    except Exception as error:
        complain(f"the picture was not drawn: {printable(error)}")
