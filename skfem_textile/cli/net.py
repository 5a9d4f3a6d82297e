"""The command ``net``: lay a kinematic net on a tool."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import shapely
from numpy import ndarray

from .. import drape, io
from ..io.file_numbers import errors_about
from ..mesh.extents import diagonal_of, warn_of_outline
from ..mesh.graph import boundary_edges
from ..mesh.progress import log_to_stderr, shown
from ..mesh.user_input import IN_MM, coords, printable
from ..nets.course import side_by_side
from ..nets.crossings import Net, NetError
from ..nets.flat_pattern import FlatPattern, spaced
from ..nets.part import first_layer
from ..nets.sheet import REACH, Sheet, fibres_on_tool
from ..outlines import Outline
from ..scenes.drape import contact_point
from ..surfaces.triangle_mesh import TriangleMesh
from .export import PartExport, decks_in, write_patterns
from .interruption import held
from .net_report import (
    Cells,
    Cover,
    Part,
    figures_of,
    refuse_overlap,
    useless_darts,
    verdict_of,
)
from .output import STOPPED_EARLY, complain, say
from .page import rows, say_rows, sources, write_page
from .result_folder import ResultFolder
from .run_options import typed

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

# Pictures on the page, and their captions.
_CAPTIONS = {
    _PICTURE: "Shear angle of the net on the tool",
    _STARTS: "Starts that were compared, with the shear of their nets over the part",
    "pattern.svg": "Flat pattern",
}

# Reason why a tube has no pattern.
_NO_OUTLINE = (
    "no closed curve is the outline of a tube or of separate parts: "
    "specify one by --trim, or --roll-width"
)

# Options that require another one, and options that exclude others.
_REQUIRED = {
    "darts": "locking_angle",
    "overlap": "roll_width",
    "layer": "outline",
    "outline_unit": "outline",
}
_EXCLUDED = {
    "darts": ("roll_width",),
    "trim": ("roll_width",),
    "outline": ("best", "darts", "roll_width"),
    "best": ("point", "warp_along", "weft_along"),
}

# Default length of a cell relative to the diagonal of the tool.
_CELL = 0.01


def run(options: argparse.Namespace) -> int:
    """Lay a net on a tool and write its results; returns the exit code.

    Raises
    ------
    ValueError
        If a file is refused, or the net cannot start.
    OSError, OutputError
        If the folder cannot be written.
    """
    _refuse_combinations(options)
    began = perf_counter()
    log_to_stderr(0)
    export = PartExport.of_options(options, known=["output.trim"])
    export = replace(export, curves=(), no_curves="")
    export.refuse_folder(options.out)
    with shown("laying the net", printed=True):
        part = _laid(options)
        fibres = fibres_on_tool(Sheet.of_net(part), part.tool.facets)
        cells, cover = Cells.of(part), Cover.of(part, fibres)
    figures = figures_of(part, cells, cover, options)
    verdict = verdict_of(part, cells, cover, options)
    files = *PartExport.all_files, *decks_in(options.out)
    out = ResultFolder(
        options.out,
        (_SUMMARY, _NET, *_FIBRES, *files, _PICTURE, _STARTS, _PAGE),
    )
    with held(), out as folder:
        if export:
            figures |= export.write(Sheet.of_net(part), "", folder)
        for name in _FIBRES:
            io.write_fibres(folder / name, fibres)
        io.write_net(folder / _NET, cells)
        if part.patterns:
            courses = len(part.patterns) > 1
            patterns = side_by_side(part.patterns) if courses else part.patterns
            write_patterns(folder, patterns, export.kinds)
        if not options.no_render:
            _draw(part, cells, options, folder)
        figures["time_s"] = perf_counter() - began
        io.write_summary(figures, folder / _SUMMARY)
        write_page(
            *(folder, _PAGE, _PAGE),
            title=f"Net on {printable(Path(options.tool[0]).name)}",
            verdict=verdict,
            figures=rows(figures),
            pictures=sources(folder, _CAPTIONS),
        )
    say_rows(verdict)
    written_to = f"results written to {printable(options.out)}"
    say(f"{written_to}: open {_PAGE}{out.removed_text()}")
    no_use = part.no_darts or useless_darts(part, cells)
    if missing := export.missing(figures):
        complain("; ".join(missing))
    is_found = part.patterns and cover.is_whole and not (no_use or missing)
    return 0 if is_found else STOPPED_EARLY


def _refuse_combinations(options: argparse.Namespace) -> None:
    """Refuse options that require, or contradict, each other."""
    given = {name for name, value in vars(options).items() if value not in (None, 0)}
    for name, other in _REQUIRED.items():
        if name in given and other not in given:
            raise ValueError(f"{_flag(name)} requires {_flag(other)}")
    for name, others in _EXCLUDED.items():
        if name in given and (both := [_flag(one) for one in others if one in given]):
            raise ValueError(
                f"{_flag(name)} cannot be combined with {' and '.join(both)}"
            )


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _laid(options: argparse.Namespace) -> Part:
    """Read the tool, lay the net and trim its pattern."""
    outline = None if options.outline is None else _outline(options)
    tool = io.read_surface(options.tool, options.unit, certain=True)
    if outline is not None:
        points = tool.facets.points
        warn_of_outline(options.outline, outline.polygon, [points])
    warp = np.radians(options.fibres or 0.0)
    angles = warp, warp + np.pi / 2
    cell, loops = _cell(tool, options.cell), _edges(tool, options)
    spanned = tool.without_holes() if len(loops) > 1 else tool
    has_outline = len(loops) == 1 or (loops and len(spanned.facets.boundary()) == 1)
    warp_along, weft_along = (
        file and _curve(file, spanned, cell, is_closed=False)
        for file in (options.warp_along, options.weft_along)
    )
    trim = [_curve(file, spanned, cell, is_closed=True) for file in options.trim or ()]
    curves = trim or (loops if has_outline else [])
    inside = np.ones(tool.facets.n_elements, dtype=bool)
    if options.trim:
        with errors_about(", ".join(map(str, options.trim))):
            of_part = drape.triangles_of_part(spanned, curves[0], curves[1:])
        inside = of_part[: len(inside)]
    around = options.trim and not has_outline
    search, point = None, _start(tool, options.point, inside if around else None)
    start = drape.NetStart(point, drape.Axes.at(tool, point).turn[:, 0])
    if options.best:
        points = tool.facets.points
        if curves:
            points = drape.points_of_part(spanned, curves[0], curves[1:])
        search = drape.best_start(
            spanned,
            cell,
            angles=angles,
            points=points,
            measure=options.best,
            search_cell=max(cell, _SEARCHED * diagonal_of(points)),
            fixed_direction=options.fibres is not None,
            others=[start],
        )
        start = search.start
    settings: dict[str, Any] = {
        **start._asdict(),
        "angles": angles,
        "warp_along": warp_along,
        "weft_along": weft_along,
    }
    part = Part(tool, inside=inside, search=search, outline=outline)
    part = part._replace(meets_itself=not has_outline)
    return _pieces(options, part, spanned, cell, curves, settings)


def _cell(tool: TriangleMesh, given: float | None) -> float:
    """Length of a cell in mm."""
    size = diagonal_of(tool.facets.points)
    cell = given or _CELL * size
    if not _FINEST <= cell / size <= _COARSEST:
        raise ValueError(
            f"the length of a cell must be between {_FINEST * size:.3g} and "
            f"{_COARSEST * size:.3g} mm on a tool with a diagonal of {size:.4g} mm, "
            f"got {cell:g} mm"
        )
    return cell


def _outline(options: argparse.Namespace) -> Outline:
    """Outline of the flat ply, its middle at the origin."""
    with typed(options):
        outline = Outline.from_file(
            options.outline, unit=options.outline_unit, layer=options.layer
        )
    low, high = outline.polygon.min(axis=1), outline.polygon.max(axis=1)
    middle = 0.5 * (low + high)[:, None]
    return Outline(outline.polygon - middle, [hole - middle for hole in outline.holes])


def _edges(tool: TriangleMesh, options: argparse.Namespace) -> list[ndarray]:
    """Closed curves along the edges of a tool; none if it is closed."""
    what = ", ".join(map(printable, options.tool))
    if boundary_edges(tool.facets.cells).size:
        with errors_about(what):
            return tool.facets.boundary()
    if options.trim or options.roll_width is not None:
        return []
    raise ValueError(
        f"{what}: the tool is closed and has no "
        "edges along which the net is trimmed: specify --trim"
    )


def _curve(file: Path, tool: TriangleMesh, cell: float, is_closed: bool) -> ndarray:
    """Curve of a file: a closed one must be on the tool, another one in a place."""
    curve = io.read_curve(file, 3 if is_closed else 2)
    if wrong := _off_tool(tool, curve, cell, is_closed):
        fitting = [
            unit
            for unit, mm in IN_MM.items()
            if not _off_tool(tool, mm * curve, cell, is_closed)
        ]
        advice = (
            f"its coordinates are in {fitting[0]}: state this unit in the file, as "
            f"'x ({fitting[0]})' in the header of a table"
            if fitting
            else "specify a curve on the tool, in the axes of its file"
        )
        raise ValueError(f"{printable(file)}: {wrong}; {advice}")
    return curve


def _off_tool(tool: TriangleMesh, curve: ndarray, cell: float, is_closed: bool) -> str:
    """Say that a curve is not on a tool, or smaller than a cell; empty if neither."""
    away = tool.from_triangles(curve)
    far = np.flatnonzero(away > (REACH if is_closed else 1.0) * cell)
    if far.size and (is_closed or far.size == away.size):
        return (
            f"the curve leaves the tool: {far.size} of its {curve.shape[1]} points are "
            f"up to {away.max():.3g} mm from it, the first at "
            f"{coords(curve[:, far[0]])} mm"
        )
    extent = diagonal_of(curve)
    if extent < cell:
        return f"the curve extends over {extent:.3g} mm, a cell over {cell:.3g} mm"
    return ""


def _pieces(
    options: argparse.Namespace,
    part: Part,
    spanned: TriangleMesh,
    cell: float,
    curves: Sequence[ndarray],
    settings: dict[str, Any],
) -> Part:
    """Lay courses, a net with darts, or a net, and trim the pattern."""
    if options.roll_width is not None:
        strips = drape.courses(
            spanned, cell, options.roll_width, options.overlap, **settings
        )
        pieces = [piece for strip in strips for piece in strip.pieces]
        patterns = [strip.pattern for strip in strips]
        return part._replace(pieces=pieces, patterns=patterns)
    if options.darts and not curves:
        part = part._replace(no_darts="the part has no outline")
    elif options.darts:
        limit = float(np.radians(options.locking_angle))
        try:
            cut = drape.net_with_darts(spanned, cell, limit, **settings)
            found = drape.pattern_with_darts(cut, curves[0], holes=curves[1:])
            refuse_overlap(part, found)
            return part._replace(
                pieces=cut.pieces,
                patterns=[found.pattern],
                darts=found.darts,
                uncut_angle=_uncut_angle(part, cut.uncut, curves),
            )
        except ValueError as error:
            part = part._replace(no_darts=str(error))
    net = drape.net(spanned, cell, **settings)
    pieces = [(net, first_layer(net))] if part.meets_itself else net.pieces
    part = part._replace(pieces=pieces)
    if part.outline is not None:
        trim = curves if options.trim else []
        return _of_outline(options.outline, part, part.outline, spanned, trim)
    if not curves:
        return part._replace(no_pattern=_NO_OUTLINE)
    try:
        return part._replace(patterns=[_pattern(part, curves)])
    except ValueError as error:
        pieces = [(net, first_layer(net))]
        return part._replace(pieces=pieces, no_pattern=str(error))


def _of_outline(
    file: Path,
    part: Part,
    outline: Outline,
    spanned: TriangleMesh,
    curves: Sequence[ndarray],
) -> Part:
    """The part of a net within the outline of the flat ply, and its pattern.

    Without curves the part is what the ply covers.
    """
    net, cells = part.pieces[0]
    # Cells on its edges cover what a curve on the tool trims.
    shape = outline.shape().buffer(0.0 if curves else net.cell)
    within = shapely.contains_xy(shape, *net.centres())
    ply = part._replace(pieces=[(net, cells & within)])
    try:
        if curves:
            return ply._replace(patterns=[_pattern(ply, curves)])
        curves = [net.at(spaced(ring, net.cell)) for ring in outline.rings]
        inside = drape.triangles_of_part(spanned, curves[0], curves[1:])
        ply = ply._replace(inside=inside[: part.tool.facets.n_elements])
        return ply._replace(patterns=[_pattern(part, curves)])
    except ValueError as error:
        reason = str(error)
        if isinstance(error, NetError) and not (net.folds.size or net.leaves.size):
            place = _on_edge(part.tool, error.position)
            reason = (
                f"net: the ply runs off the edge of the tool at {coords(place)} mm: "
                "move the start with --point, or specify a smaller ply"
            )
        extent = " x ".join(f"{x:.4g}" for x in np.ptp(outline.polygon, axis=1))
        reason = f"{printable(file)}: outline of {extent} mm: {reason}"
        return ply._replace(no_pattern=reason)


def _on_edge(tool: TriangleMesh, x: ndarray) -> ndarray:
    """Point on the edges of a tool closest to a point, shape (3,)."""
    start, end = tool.facets.points[:, boundary_edges(tool.facets.cells)].swapaxes(0, 1)
    along, away = end - start, x[:, None] - start
    share = np.clip((away * along).sum(axis=0) / (along**2).sum(axis=0), 0.0, 1.0)
    places = start + share * along
    return np.asarray(places[:, np.linalg.norm(places.T - x, axis=1).argmin()])


def _uncut_angle(part: Part, uncut: Net, curves: Sequence[ndarray]) -> float | None:
    """Largest shear angle without darts in degrees; None if no pattern is whole."""
    if uncut.folds.size:
        return None
    part = part._replace(pieces=uncut.pieces)
    try:
        cells = Cells.of(part._replace(patterns=[_pattern(part, curves)]))
    except ValueError:
        return None
    return float(cells.angles.max())


def _pattern(part: Part, curves: Sequence[ndarray]) -> FlatPattern:
    """Flat pattern of the net within closed curves: the outline, then holes."""
    return drape.flat_pattern(Sheet.of_net(part), curves[0], holes=curves[1:])


def _start(
    tool: TriangleMesh, point: Sequence[float] | None, inside: ndarray | None
) -> ndarray:
    """Given point of a tool, else the highest, or one near the middle.

    Of a part around which the tool goes on, by its mask of triangles, it is the middle.
    """
    if point is not None or inside is None:
        try:
            return contact_point(tool, point)
        except ValueError:
            if point is not None:
                raise
    centres, areas = tool.facets.centres(), tool.facets.areas()
    if inside is not None:
        centres, areas = centres[:, inside], areas[inside]
    middle = np.average(centres, axis=1, weights=areas)
    near = np.linalg.norm(centres - middle[:, None], axis=0).argmin()
    return contact_point(tool, centres[:, near].tolist())


def _draw(part: Part, cells: Cells, options: argparse.Namespace, folder: Path) -> None:
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
