"""Meshes from Gmsh, Abaqus and VTK files, and from other formats of meshio."""

import logging
import os
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri

from ..mesh.checks import (
    MeshError,
    check_mesh,
    refuse,
    refuse_metres,
    refuse_positions,
)
from ..mesh.graph import boundary_edges
from ..mesh.progress import shown
from ..mesh.requirements import without_messages
from ..mesh.scikit_fem import with_names
from ..mesh.selection import with_named_nodes
from ..mesh.splitting import named_edges, split_cells
from ..mesh.user_input import printable
from . import abaqus, gmsh, vtk
from .file_numbers import errors_about

# Extent of a mesh along z, relative to its largest extent, below which it is plane.
# Chosen: far above rounding (2e-16).
_FLAT = 1e-9

log = logging.getLogger(__name__)

_MESH_CLASSES: dict[str, type[Mesh]] = {"quad": MeshQuad, "triangle": MeshTri}
_N_CORNERS = {"vertex": 1, "line": 2, "triangle": 3, "quad": 4}
# Formats with dedicated readers, because meshio accepts many errors in them.
_READERS = {
    ".msh": gmsh.read,
    ".inp": abaqus.read,
    ".vtu": vtk.read_xml,
    ".vtk": vtk.read_legacy,
}

#: Names of cells in messages.
CELL_NAMES = {
    "quad": "quadrilateral",
    "line": "edge",
    "line3": "edge",
    "vertex": "point",
}


def read_mesh(path: str | os.PathLike[str], others: Collection[str] = ()) -> Mesh:
    """Read a plane mesh: Gmsh .msh, Abaqus .inp with include files, .vtu and others.

    Quadrilaterals become a `skfem.MeshQuad` and triangles a `skfem.MeshTri`.  A file
    with both is split into quadrilaterals (`split_cells`), as scikit-fem has no mixed
    mesh; the nodes of the file come first.  Named groups of edges (Gmsh physical
    groups) and the outer edges between nodes of a named set (Abaqus node sets) become
    boundaries of that name; the other nodes of a set, and named points, become named
    nodes.  A warning in the log ``skfem_textile`` lists the ignored content of the
    file.

    Parameters
    ----------
    path
        The file.
    others
        Names of content that other functions read, which the warning omits:
        `OF_DIRECTIONS`, `OF_FABRICS`.

    Raises
    ------
    MeshError
        If the file cannot be read, has cells other than triangles and four-node
        quadrilaterals, is not in a plane z = const, names edges outside the mesh, is
        not a valid mesh (`check_mesh`), or is less than 1 mm wide and high, which
        indicates a mesh in metres.
    """
    path = Path(path)
    with errors_about(path), shown(f"reading mesh {printable(path.name)}"):
        raw, ignored = read_raw(path)
        mesh = _mesh(_content(raw))
        refuse_metres(mesh.p)
    say_ignored(path, [name for name in ignored if name not in others])
    return mesh


def say_ignored(path: Path, names: Iterable[str]) -> None:
    """List the ignored content of a file in the log, each name once."""
    if listed := ", ".join(map(printable, dict.fromkeys(names))):
        log.warning("%s: ignored: %s", printable(path), listed)


def read_raw(path: Path) -> tuple[meshio.Mesh, list[str]]:
    """Content of a file, and names of its ignored parts."""
    refuse_no_file(path)
    if read := _READERS.get(path.suffix.lower()):
        return read(abaqus.content_of(path))
    return _read_with_meshio(path)


def refuse_no_file(path: Path) -> None:
    """Refuse a path of no file."""
    if not path.is_file():
        raise MeshError("this is a folder" if path.is_dir() else "no such file")


def damaged(path: Path, error: BaseException) -> BaseException:
    """Error about a file that another package cannot read, without its words.

    An error that names a file, such as one without permission, remains as it is.
    """
    if isinstance(error, OSError) and error.filename is not None:
        return error
    return MeshError(
        f"the file is damaged, or is not a {path.suffix} file: export it again"
    )


def _read_with_meshio(path: Path) -> tuple[meshio.Mesh, list[str]]:
    """Read with meshio, which prints messages and exits on errors."""
    suffixes = ["".join(path.suffixes[k:]).lower() for k in range(len(path.suffixes))]
    if not meshio.extension_to_filetypes.keys() & set(suffixes):
        suffix = (
            f"{printable(path.suffix)} files" if path.suffix else "files without suffix"
        )
        raise MeshError(
            f"{suffix} are not supported: export the mesh as .stl, .obj, .msh, .inp or "
            ".vtu"
        )
    try:
        with without_messages():
            if path.suffix.lower() == ".obj":
                raw = meshio.read(_faces_of_obj(path), "obj")
            else:
                raw = meshio.read(path)
    except ImportError as error:
        package = printable(error.name or "another package")
        raise MeshError(
            f"reading this {path.suffix} file requires {package}, which is not "
            f"installed: pip install {package}, or save the mesh as .vtu or .msh"
        ) from None
    except KeyError as error:
        what = " ".join(map(printable, error.args))
        raise MeshError(
            f"the file refers to {what}, which it does not define"
        ) from None
    except (Exception, SystemExit) as error:
        raise damaged(path, error) from None
    fields = [n for n in raw.point_data if not n.startswith("gmsh:")]
    fields += [n for n in raw.cell_data if not n.startswith(("gmsh:", "skfem:"))]
    if not any(name.startswith("gmsh:") for name in raw.cell_data):
        fields += raw.field_data
    return raw, fields


def _faces_of_obj(path: Path) -> StringIO:
    """Vertices and faces of an OBJ file.

    meshio requires as many normals and texture coordinates as vertices, or none.
    """
    with open(path, encoding="utf-8", errors="replace") as file:
        lines = [line for line in file if line.split(None, 1)[:1] in (["v"], ["f"])]
    return StringIO("".join(lines))


@dataclass
class _Content:
    """Content of a file.

    Nodes of shape (2, n), blocks of cells of shape (3, n) and (4, n), and by name: end
    nodes of edges, shape (2, n), cell numbers over all blocks, and nodes.
    """

    points: ndarray
    cells: list[ndarray]
    edges: dict[str, ndarray] = field(default_factory=dict)
    subdomains: dict[str, ndarray] = field(default_factory=dict)
    nodes: dict[str, ndarray] = field(default_factory=dict)


def _content(raw: meshio.Mesh) -> _Content:
    points = np.asarray(raw.points, dtype=float)
    if points.ndim != 2 or points.shape[1] < 2:
        raise MeshError("the nodes must have two or three coordinates")
    refuse_positions(points.T)
    blocks = [i for i, block in enumerate(raw.cells) if len(block.data)]
    kinds = {raw.cells[i].type for i in blocks} - {"vertex", "line"}
    if not kinds or not kinds <= set(_MESH_CLASSES):
        names = printable(", ".join(sorted(kinds)) or "none")
        raise MeshError(
            "only triangles and four-node quadrilaterals are supported, found " + names
        )
    size = np.ptp(points, axis=0)
    if not np.all(size[2:] <= _FLAT * size[:2].max()):
        raise MeshError("the mesh must lie in a plane z = const")
    _refuse_numbers(raw, blocks)
    plane = [i for i in blocks if raw.cells[i].type in _MESH_CLASSES]
    cells = [np.asarray(raw.cells[i].data, dtype=int).T for i in plane]
    content = _Content(points[:, :2].T.copy(), cells)
    _name_groups(content, raw, plane)
    _name_node_sets(content, raw)
    _name_as_skfem(content, raw, plane)
    return content


def _refuse_numbers(raw: meshio.Mesh, blocks: list[int]) -> None:
    """Refuse cells with undefined nodes; cells are numbered by kind, as in the file."""
    n = len(raw.points)
    for kind in dict.fromkeys(raw.cells[i].type for i in blocks):
        nodes = [raw.cells[i].data for i in blocks if raw.cells[i].type == kind]
        if any(np.shape(x)[1:] != (_N_CORNERS[kind],) for x in nodes):
            raise MeshError(f"a {kind} must have {_N_CORNERS[kind]} node(s)")
        listed = np.concatenate([np.asarray(x).astype(np.int64) for x in nodes])
        exists: Any = ((listed >= 0) & (listed < n)).all(axis=1)
        refuse(
            f"{CELL_NAMES.get(kind, kind)}(s) refer to an undefined node (node "
            f"numbers range from 0 to {n - 1})",
            ~exists,
        )


def _name_groups(content: _Content, raw: meshio.Mesh, plane: list[int]) -> None:
    """Name groups of edges, cells and points."""
    sizes = [cell.shape[1] for cell in content.cells]
    first = dict(zip(plane, np.cumsum([0, *sizes[:-1]]), strict=True))
    for name, number, members in _groups(raw):
        block = raw.cells[number]
        if members.min() < 0 or members.max() >= len(block.data):
            raise MeshError(f"group {name!r} refers to undefined cells")
        chosen = np.asarray(block.data, dtype=int)[members].T
        if block.type == "line":
            _merge(content.edges, name, np.sort(chosen, axis=0))
        elif block.type == "vertex":
            _merge(content.nodes, name, chosen[0])
        elif number in first:
            _merge(content.subdomains, name, first[number] + members)


def _groups(raw: meshio.Mesh) -> Iterator[tuple[str, int, ndarray]]:
    """Named groups of cells: name, block of cells, numbers in the block.

    For files converted from Gmsh, such as .xdmf, meshio returns them as tags.
    """
    sets: Any = {n: s for n, s in raw.cell_sets.items() if not n.startswith("gmsh:")}
    tags: Any = raw.cell_data.get("gmsh:physical", [])
    for name, group in raw.field_data.items() if tags else ():
        if np.shape(group) != (2,):
            raise MeshError(f"group {name!r} must have a number and a dimension")
        tag, dimension = group
        if name not in sets:
            sets[name] = [
                np.flatnonzero(physical == tag) if block.dim == dimension else None
                for block, physical in zip(raw.cells, tags, strict=False)
            ]
    for name, of_blocks in sets.items():
        for number, members in enumerate(of_blocks[: len(raw.cells)]):
            if members is not None and len(members):
                yield name, number, np.asarray(members).astype(int).ravel()


def _merge(named: dict[str, ndarray], name: str, more: ndarray) -> None:
    """Add members to a name, without duplicates."""
    if name in named:
        more = np.concatenate([named[name], more], axis=-1)
    named[name] = np.unique(more, axis=-1)


def _name_node_sets(content: _Content, raw: meshio.Mesh) -> None:
    """Name the outer edges within each set of nodes, and its other nodes."""
    outer = np.sort(boundary_edges(content.cells), axis=0)
    n = content.points.shape[1]
    for name, members in raw.point_sets.items():
        nodes = np.asarray(members).astype(int).ravel()
        if nodes.size and (nodes.min() < 0 or nodes.max() >= n):
            raise MeshError(f"node set {name!r} refers to undefined nodes")
        within = outer[:, np.isin(outer, nodes).all(axis=0)]
        other_nodes = np.setdiff1d(nodes, within)
        if within.size:
            _merge(content.edges, name, within)
        if other_nodes.size:
            _merge(content.nodes, name, other_nodes)


def _name_as_skfem(content: _Content, raw: meshio.Mesh, plane: list[int]) -> None:
    """Read the names that scikit-fem writes as cell data.

    For a boundary, bit i of the value of a cell is set for its edge i.
    """
    data = {k: v for k, v in raw.cell_data.items() if k.startswith(vtk.SKFEM)}
    if not data:
        return
    if len(raw.cells) > 1:
        raise MeshError(
            "names written by scikit-fem can be read only from a file with one block "
            "of cells"
        )
    (cells,) = content.cells
    for key, (values,) in data.items():
        kind, _, name = key.removeprefix(vtk.SKFEM).partition(":")
        largest = {"s": 1, "b": 2 ** len(cells) - 1}.get(kind, -1)
        marks = np.ravel(values)
        if len(marks) != cells.shape[1] or not np.isin(marks, range(largest + 1)).all():
            raise MeshError(
                f"the cell data of the name {name!r} written by scikit-fem are not "
                "valid"
            )
        if kind == "s":
            _merge(content.subdomains, name, np.flatnonzero(marks))
            continue
        bits = marks.astype(int) >> np.arange(len(cells))[:, None] & 1
        ends = np.stack([cells, np.roll(cells, -1, axis=0)])
        _merge(content.edges, name, np.sort(ends[:, bits > 0], axis=0))


def _mesh(content: _Content) -> Mesh:
    points, cells, edges = content.points, content.cells, content.edges
    corners = {len(cell) for cell in cells}
    if len(corners) > 1:
        mesh = split_cells(points, cells, edges, content.subdomains, content.nodes)
        check_mesh(mesh)
        return mesh
    kind = MeshTri if 3 in corners else MeshQuad
    plain = kind(points, np.ascontiguousarray(np.hstack(cells)))
    check_mesh(plain)
    boundaries = {k: named_edges(k, points, plain.facets, v) for k, v in edges.items()}
    ascending = {k: np.sort(v) for k, v in boundaries.items()}
    named = with_names(plain, ascending or None, content.subdomains or None)
    return with_named_nodes(named, content.nodes)
