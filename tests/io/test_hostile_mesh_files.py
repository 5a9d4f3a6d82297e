"""Damaged mesh files are rejected in one line, or read as by another reader."""

import contextlib
import io
import logging
import warnings
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import strategies as st
from skfem import MeshTri

from skfem_textile import MeshError, split
from skfem_textile.io import read_mesh
from skfem_textile.mesh.selection import named_nodes
from skfem_textile.mesh.splitting import was_split
from tests.helpers.hostile import (
    RIGHT,
    Family,
    UnclearError,
    WrongAnswerError,
    expect,
    is_clear,
    rejected_if_damaged,
    seeds,
)
from tests.helpers.hostile import mesh_files as files
from tests.helpers.hostile import mesh_readers as readers
from tests.helpers.hostile.damage import damaged

# Files written by Gmsh.
MESHES = Path(__file__).parent / "meshes"

READERS = {
    **{".msh": readers.gmsh, ".inp": readers.abaqus},
    **{".vtu": readers.vtu, ".vtk": readers.vtk},
}

# By format: the suffix, the writer of a mesh, and a pattern of files by Gmsh.
FORMATS = {
    "msh 2.2": (".msh", files.gmsh_22, "*22.msh"),
    "msh 4.1": (".msh", files.gmsh_41, "*41*.msh"),
    "inp": (".inp", files.abaqus, "*.inp"),
    "vtu": (".vtu", files.vtu, ""),
    "vtk": (".vtk", files.vtk, ""),
}

# Prefix of printed lines, and of warnings that are not logged.
LOUD = "aloud: "

# Thickness up to which a mesh is plane, as a share of its size.
PLANE = 1e-9


class MeshFile(NamedTuple):
    """A file, and a flag for splitting its triangles."""

    name: str
    content: bytes
    damage: str
    is_split: bool


@st.composite
def mesh_files(draw, name):
    """One in 60 has the suffix of another format, one in 40 an odd size."""
    suffix, write, pattern = FORMATS[name]
    rng, odd, one_kind = np.random.default_rng(draw(seeds)), "", True
    if pattern and rng.integers(0, 8) == 0:
        content = rng.choice(sorted(MESHES.glob(pattern))).read_bytes()
    else:
        mesh = files.sound_mesh(rng, not pattern and bool(rng.integers(0, 2)))
        if rng.integers(0, 40) == 0:
            mesh.points *= 10.0 ** rng.integers(-300, 300)
            odd = " size"
        content, one_kind = write(mesh, rng), len(mesh.kinds) == 1
    content, damage = draw(damaged(content))
    if rng.integers(0, 60) == 0:
        suffix, odd = rng.choice([*READERS, ".mesh", ".txt", ""]), " suffix"
    is_split = bool(rng.integers(0, 2)) or not one_kind
    return MeshFile(f"mesh{suffix}", content, damage + odd, is_split)


def attempt(file):
    path = Path(file.name)
    path.write_bytes(file.content)
    with messages() as heard:
        try:
            mesh = read_mesh(path)
            if file.is_split and isinstance(mesh, MeshTri):
                mesh = split(mesh)
        except MeshError as error:
            if heard:
                raise UnclearError(heard) from None
            return rejected_if_damaged(error, file.damage)
        expected = all(line.startswith(f"{path}: ignored: ") for line in heard)
        if len(heard) > 1 or not expected or not all(map(is_clear, heard)):
            raise UnclearError(heard)
        expect(path.suffix in READERS, "there is no such format")
        try:
            content = READERS[path.suffix](file.content)
        except readers.MalformedError as error:
            raise WrongAnswerError(f"malformed: {error}") from None
        expect(content or file.damage, "meshio cannot read a sound file")
        if content:
            compare(mesh, content)
    return RIGHT


@contextlib.contextmanager
def messages():
    """Log messages, warnings and prints of a block; prints come last."""
    heard, out, handler = [], io.StringIO(), logging.Handler()
    handler.emit = lambda record: heard.append(record.getMessage())
    logging.getLogger().addHandler(handler)
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(out),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("always")
            warnings.showwarning = lambda text, *_: heard.append(f"{LOUD}{text}")
            yield heard
            if out.getvalue():
                raise UnclearError(f"{LOUD}{out.getvalue()!r}")
    finally:
        logging.getLogger().removeHandler(handler)


# Content read by the library and by a plain reader


def compare(mesh, content):
    """Check for equal positions, cells and names."""
    x = np.array(content.points, dtype=float)
    expect(np.isfinite(x).all(), "positions that are not finite were read")
    size = np.ptp(x, axis=0)
    expect((size[2:] <= PLANE * size[:2].max()).all(), "nodes are not in a plane")
    is_split = was_split(mesh)
    cells, n = mesh.cells if is_split else [mesh.t], len(x)
    expect(np.array_equal(mesh.p[:, :n].T, x[:, :2]), "positions differ")
    expect(is_split or mesh.p.shape[1] == n, "there are other nodes")
    read = [normalised(cell) for block in cells for cell in block.T.tolist()]
    theirs = [normalised(cell) for cell in content.cells]
    expect(Counter(read) == Counter(theirs), "cells differ")
    edges, nodes = edges_and_nodes(content)
    ends = {k: [(edge, x[sorted(edge), :2]) for edge in e] for k, e in edges.items()}
    for title, computed, expected in (
        ("boundaries", boundaries(mesh), pieces(ends, is_split)),
        ("subdomains", regions(mesh, read), content.regions),
        ("named nodes", {k: v.tolist() for k, v in named_nodes(mesh).items()}, nodes),
    ):
        if title == "subdomains":
            expected = {k: [theirs[i] for i in v] for k, v in expected.items()}
        computed, expected = (
            {name: sorted(members) for name, members in named.items() if len(members)}
            for named in (computed, expected)
        )
        expect(computed == expected, f"{title}: {computed}, expected {expected}")


def normalised(cell):
    """The nodes of a cell, the same from any first corner and in either direction."""
    walk = tuple(cell)
    ways = [walk[i:] + walk[:i] for i in range(len(walk))]
    return min(ways + [order[::-1] for order in ways])


def edges_and_nodes(content):
    """Named edges and nodes, of sets of nodes included."""
    edges = {name: set(members) for name, members in content.edges.items()}
    nodes = {name: set(members) for name, members in content.nodes.items()}
    times = Counter(
        frozenset(ends) for c in content.cells for ends in pairwise((*c, c[0]))
    )
    for name, members in content.node_sets.items():
        within = {edge for edge, n in times.items() if n == 1 and edge <= members}
        edges.setdefault(name, set()).update(within)
        nodes.setdefault(name, set()).update(members.difference(*within))
    return edges, nodes


def pieces(named, is_split):
    """Edges by their ends; where the mesh was split, halves by end and middle."""
    return {
        name: [
            piece
            for edge, ends in edges
            for piece in (
                [(a, *ends.mean(axis=0)) for a in sorted(edge)]
                if is_split
                else [tuple(sorted(edge))]
            )
        ]
        for name, edges in named.items()
    }


def boundaries(mesh):
    """Edges of the mesh in the form of `pieces`; the middle has the higher number."""
    named = {}
    for name, edges in (mesh.boundaries or {}).items():
        pairs = np.sort(mesh.facets[:, np.asarray(edges)], axis=0).T.tolist()
        halves = [(a, *mesh.p[:, b]) for a, b in pairs]
        named[name] = halves if was_split(mesh) else [tuple(pair) for pair in pairs]
    return named


def regions(mesh, nodes):
    """Cells of the subdomains; () for a cell of which a piece is missing."""
    named = {}
    for name, elements in (mesh.subdomains or {}).items():
        members = np.asarray(elements).tolist()
        named[name] = [nodes[i] for i in members] if not was_split(mesh) else []
        if was_split(mesh):
            times, whole = (
                Counter(x.tolist()) for x in (mesh.parent[members], mesh.parent)
            )
            named[name] = [nodes[c] if whole[c] == t else () for c, t in times.items()]
    return named


FAMILIES = tuple(
    Family(name, {"": mesh_files(name)}, attempt, 1500 if "vt" in name else 2500)
    for name in FORMATS
)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_a_damaged_mesh_is_rejected_or_read_correctly(family):
    family.check(12)
