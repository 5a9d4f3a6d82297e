"""Tools from files of triangles: STL, PLY, OBJ, 3MF, and formats of meshio."""

import logging
import os
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.extents import SMALLEST
from ..mesh.requirements import lacks, without_messages
from ..mesh.user_input import IN_MM, printable, refuse_unit
from ..surfaces.tool_mesh import ToolMesh, cut_in_two
from ..surfaces.triangle_mesh import TriangleMesh
from .file_numbers import errors_about, from_words
from .meshes import (
    CELL_NAMES,
    damaged,
    read_raw,
    refuse_no_file,
    say_ignored,
)

log = logging.getLogger(__name__)

#: Units of length of a file.
Unit: TypeAlias = Literal["mm", "cm", "m", "in"]

# Extent of a tool in mm outside of which its unit is doubtful.  Chosen: a coin, and the
# mould of half of the blade of a small wind turbine.
_LEAST, _MOST = SMALLEST, 20e3

# Extent in mm below which an assumed unit is named: many dies in cm or inches are so
# small, and few in mm.
_SMALL = 40.0

# Units that a file without one may have, the most frequent first.
_UNITS = ("m", "in", "cm")

# Bytes of the header and of a triangle of a binary STL file.
_HEADER, _TRIANGLE = 84, 50

# Corners of cells of a surface.  Those of quadratic cells are their first nodes.
_CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}

_OF_TRIMESH = (".ply", ".obj", ".3mf")
_EXACT = (".step", ".stp", ".iges", ".igs", ".brep", ".x_t", ".sat")

_PathLike: TypeAlias = str | os.PathLike[str]


def read_surface(
    path: _PathLike | Sequence[_PathLike],
    unit: Unit | None = None,
    certain: bool = False,
) -> TriangleMesh:
    """Read a smoothed tool surface: STL, PLY, OBJ, 3MF, or a format of meshio.

    Quadrilaterals are cut into triangles.  Other cells are ignored, and so are
    triangles with coincident corners, as at the pole of a sphere.  Several files, and
    several solids of one file, are sewn.  Warnings in the log ``skfem_textile``
    list what is ignored, each repair, and each property that affects results
    (`skfem_textile.drape.TriangleMesh.remarks`).

    Parameters
    ----------
    path
        The file, or several.  PLY, OBJ and 3MF require trimesh.
    unit
        Unit of length of the files.  By default the unit of a 3MF file, else mm.
    certain
        Refuse a tool whose extent indicates another unit, unless one is given; by
        default this is a remark.

    Raises
    ------
    MeshError
        If a file cannot be read or does not contain a surface, or the triangles cannot
        be repaired.
    ValueError
        If the unit is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> import meshio
    >>> s = np.linspace(0.0, 0.1, 5)  # in m
    >>> x, y = (a.ravel() for a in np.meshgrid(s, s))
    >>> k = np.add.outer(5 * np.arange(4), np.arange(4)).ravel()
    >>> t = np.hstack([[k, k + 1, k + 6], [k, k + 6, k + 5]])
    >>> points = np.column_stack([x, y, 0 * x])
    >>> meshio.write_points_cells("plate.stl", points, [("triangle", t.T)])
    >>> plate = read_surface("plate.stl", unit="m")
    >>> float(np.ptp(plate.facets.points))
    100.0
    """
    refuse_unit(unit)
    paths = [path] if isinstance(path, str | os.PathLike) else list(path)
    if not paths:
        raise ValueError("a tool requires at least one file")
    name, parts, known = ", ".join(map(str, paths)), [], unit is not None
    for one in paths:
        with errors_about(one):
            x, t, own = _triangles(Path(one))
        known |= own is not None
        parts.append((IN_MM[unit] if unit else own or 1.0, x, t))
    first = np.cumsum([0, *(x.shape[1] for _, x, _ in parts)])
    with errors_about(name):
        with np.errstate(over="ignore"):
            x = np.hstack([scale * x for scale, x, _ in parts])
        t = np.hstack([n + t for n, (*_, t) in zip(first, parts, strict=False)])
        surface = TriangleMesh(x, t)
    extent = float(np.ptp(surface.facets.points, axis=1).max())
    doubt = _doubt(extent, known)
    if doubt and certain and not known:
        raise MeshError(f"{printable(name)}: {doubt}")
    if not (known or doubt) and extent < _SMALL:
        doubt = (
            f"the tool is assumed in mm and extends over {extent:.3g} mm: specify its "
            "unit (--unit) if this is not so"
        )
    for line in filter(None, (doubt, *surface.remarks)):
        log.warning("%s: %s", printable(name), line)
    return surface


def _doubt(extent: float, known: bool) -> str:
    """Remark about an extent in mm that indicates another unit than the known one."""
    if _LEAST <= extent <= _MOST:
        return ""
    if known:
        return f"the tool extends over {extent:.3g} mm: check its unit"
    advice = "export it in mm if this is not so"
    if fitting := [u for u in _UNITS if _LEAST <= extent * IN_MM[u] <= _MOST]:
        advice = f"if the file is in {fitting[0]}, specify this unit"
    return f"the tool is assumed in mm and extends over {extent:.3g} mm: {advice}"


def _triangles(path: Path) -> tuple[ndarray, ndarray, float | None]:
    """Points, (3, n), triangles, (3, m), and the unit of a file in mm if it has one."""
    suffix = path.suffix.lower()
    if suffix in _EXACT:
        raise MeshError(
            f"a {suffix} file contains exact surfaces: convert it to triangles, with "
            "FreeCAD or by `gmsh -2 -clmax 5 FILE.step -o tool.stl`"
        )
    refuse_no_file(path)
    if suffix == ".stl":
        corners = _read_stl(path.read_bytes())
        if not corners.size:
            raise MeshError("the file contains no triangles")
        return corners.T, np.arange(len(corners)).reshape(-1, 3).T, None
    if suffix in _OF_TRIMESH:
        return _read_with_trimesh(path)
    points, cells = points_and_cells(path)
    return points, cut_in_two(cells), None


def _read_stl(content: bytes) -> ndarray:
    """Corners of the triangles of all solids, shape (n, 3)."""
    blocks, position = [], 0
    while position + _HEADER <= len(content):
        (count,) = np.frombuffer(content, "<u4", 1, position + _HEADER - 4)
        begin = position + _HEADER
        position = begin + _TRIANGLE * int(count)
        if position > len(content):
            break
        rows = np.frombuffer(content, np.uint8, _TRIANGLE * int(count), begin)
        floats = rows.reshape(-1, _TRIANGLE)[:, 12:48].copy().view("<f4")
        blocks.append(floats.reshape(-1, 3).astype(float))
    if blocks and position == len(content):
        return np.vstack(blocks)
    if not content.lstrip()[:5].lower() == b"solid":
        raise MeshError(
            "the file is neither an ASCII STL file nor a binary one with as many "
            "triangles as its header declares"
        )
    found = re.findall(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", content, re.IGNORECASE)
    lower = content.lower()
    facets = lower.count(b"endfacet")
    whole = re.match(rb"endsolid\b[^\n]*\s*\Z", lower[lower.rfind(b"endsolid") :])
    if len(found) != 3 * facets or not whole:
        raise MeshError(
            f"the file ends early or is damaged: {facets} complete triangles have "
            f"{len(found)} corners"
        )
    return from_words([word for row in found for word in row], float).reshape(-1, 3)


def _read_with_trimesh(path: Path) -> tuple[ndarray, ndarray, float | None]:
    suffix = path.suffix.lower()
    options: dict[str, Any] = {"skip_materials": True} if suffix == ".obj" else {}
    try:
        import trimesh

        with without_messages():
            scene = trimesh.load_scene(path, process=False, **options)
            mesh = scene.to_mesh()
            points, faces = np.array(mesh.vertices), np.array(mesh.faces)
            unit = scene.units
            own = trimesh.units.unit_conversion(unit, "mm") if unit else None
    except ImportError as error:
        package = error.name or "trimesh"
        raise MeshError(
            lacks(f"reading a {suffix} file", "tools", printable(package))
            + ", or export the tool as STL"
        ) from None
    except Exception as error:
        raise damaged(path, error) from None
    if not faces.size:
        raise MeshError("the file contains no triangles")
    return points.T.astype(float), faces.T.astype(int), own


def read_tool_mesh(path: _PathLike) -> ToolMesh:
    """Read the triangles and quadrilaterals of a tool, in the order of the file.

    Quadratic elements are read by their corners.  A warning in the log
    ``skfem_textile`` lists what is ignored.

    Parameters
    ----------
    path
        The file: STL, 3MF, which requires trimesh, or another format supported by
        meshio.

    Raises
    ------
    MeshError
        If the file cannot be read, or does not contain a surface in space.
    """
    with errors_about(path):
        if Path(path).suffix.lower() not in (".stl", ".3mf"):
            return ToolMesh(*points_and_cells(path))
        points, triangles, unit = _triangles(Path(path))
        nodes, number = np.unique(points, axis=1, return_inverse=True)
        return ToolMesh((unit or 1.0) * nodes, (number.ravel()[triangles],))


def refuse_unit_of_part(mesh: ToolMesh | None) -> None:
    """Refuse a part, if there is one, whose extent indicates another unit than mm."""
    if mesh is None:
        return
    extent = float(np.ptp(mesh.points, axis=1).max())
    if not _LEAST <= extent <= _MOST:
        raise MeshError(
            f"the part extends over {extent:.3g} mm: its lengths must be in mm"
        )


def points_and_cells(path: _PathLike) -> tuple[ndarray, tuple[ndarray, ...]]:
    """Points and cells of a file that meshio reads, as arguments of `ToolMesh`."""
    raw, ignored = read_raw(Path(path))
    others = Counter[str]()
    for block in raw.cells:
        if block.type not in _CORNERS and len(block.data):
            others[CELL_NAMES.get(block.type, block.type)] += len(block.data)
    cells = tuple(
        np.asarray(block.data, dtype=int).T[: _CORNERS[block.type]]
        for block in raw.cells
        if block.type in _CORNERS
    )
    if not any(map(np.size, cells)):
        raise MeshError("the file contains no triangles or quadrilaterals")
    if np.shape(raw.points)[1:] != (3,):
        raise MeshError("the points must have three coordinates")
    named = [f"{n} {kind}(s)" for kind, n in others.items()]
    say_ignored(Path(path), [*ignored, *named])
    return np.asarray(raw.points).T, cells
