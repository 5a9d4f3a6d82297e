"""Damaged mesh files are rejected in one line, or read as by meshio."""

import contextlib
import io
import logging
import warnings
from pathlib import Path
from typing import NamedTuple

import meshio
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
    expect,
    expect_equal,
    is_clear,
    rejected_if_damaged,
    seeds,
)
from tests.helpers.hostile import mesh_files as files
from tests.helpers.hostile.damage import damaged

# By format: the suffix, and the writer of a mesh.
FORMATS = {
    "msh 2.2": (".msh", files.gmsh_22),
    "msh 4.1": (".msh", files.gmsh_41),
    "inp": (".inp", files.abaqus),
    "vtu": (".vtu", files.vtu),
    "vtk": (".vtk", files.vtk),
}

# Prefix of printed lines, and of warnings that are not logged.
LOUD = "aloud: "


class MeshFile(NamedTuple):
    """A file, the mesh that was written to it, and its damage."""

    name: str
    content: bytes
    mesh: files.SoundMesh
    damage: str


@st.composite
def mesh_files(draw, name):
    """One in 60 has the suffix of another format, one in 40 an odd size."""
    suffix, write = FORMATS[name]
    rng, odd = np.random.default_rng(draw(seeds)), ""
    mesh = files.sound_mesh(rng, "vt" in name and bool(rng.integers(0, 2)))
    if rng.integers(0, 40) == 0:
        mesh.points *= 10.0 ** rng.integers(-300, 300)
        odd = " size"
    content, damage = draw(damaged(write(mesh, rng)))
    if rng.integers(0, 60) == 0:
        suffix, odd = rng.choice([".mesh", ".txt", ".vtk", ".inp", ""]), " suffix"
    return MeshFile(f"mesh{suffix}", content, mesh, damage + odd)


def attempt(file):
    path = Path(file.name)
    path.write_bytes(file.content)
    with messages() as heard:
        try:
            mesh = read_mesh(path)
        except MeshError as error:
            if heard:
                raise UnclearError(heard) from None
            return rejected_if_damaged(error, file.damage)
        expected = all(line.startswith(f"{path}: ignored: ") for line in heard)
        if len(heard) > 1 or not expected or not all(map(is_clear, heard)):
            raise UnclearError(heard)
    if file.damage:
        compare_with_meshio(mesh, path)
    else:
        compare(mesh, file.mesh, file.content)
    if isinstance(mesh, MeshTri):
        split(mesh)
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


# Content as read by the library


def cells_of(mesh):
    """Nodes of the cells that were in the file, sorted."""
    blocks = mesh.cells if was_split(mesh) else [mesh.t]
    return sorted(sorted(cell) for block in blocks for cell in block.T.tolist())


def compare(mesh, sound, content):
    """Check positions, cells and names against the mesh that was written."""
    n, points = len(sound.points), sound.points
    if b'type="Float32" Name="Points"' in content:
        points = points.astype(np.float32)
    expect(np.array_equal(mesh.p[:, :n].T, points), "positions differ")
    expect_equal("cells", cells_of(mesh), sorted(map(sorted, sound.cells)))
    if content.startswith((b"<?xml", b"# vtk")) and len(sound.kinds) > 1:
        return  # which has no names
    for title, read, wanted in (
        ("boundary", boundaries(mesh, n), sound.edges),
        ("subdomain", subdomains(mesh, n), cells_by_name(sound)),
        ("nodes", named_nodes(mesh), sound.nodes if content[:1] == b"$" else {}),
    ):
        for name, members in wanted.items():
            name = name if content[:1] == b"$" else name.replace(" ", "_")
            nodes = {int(node) for member in members for node in np.ravel(member)}
            expect_equal(f"{title} {name!r}", {*map(int, read[name])}, nodes)


def cells_by_name(sound):
    return {k: [sound.cells[i] for i in of] for k, of in sound.regions.items()}


def boundaries(mesh, n):
    """Nodes of the file on the boundaries."""
    named = (mesh.boundaries or {}).items()
    return {k: in_file(mesh.facets[:, np.asarray(of)], n) for k, of in named}


def subdomains(mesh, n):
    """Nodes of the file in the subdomains."""
    named = (mesh.subdomains or {}).items()
    return {k: in_file(mesh.t[:, np.asarray(of)], n) for k, of in named}


def in_file(nodes, n):
    """Numbers below n: those above are of a mesh that was split."""
    return nodes[nodes < n]


def compare_with_meshio(mesh, path):
    """Check positions and cells, unless meshio cannot read the file.

    meshio finds no nodes between lines that end with a vertical tab.
    """
    heard = io.StringIO()
    try:
        with contextlib.redirect_stdout(heard), contextlib.redirect_stderr(heard):
            other = meshio.read(path)
    except (Exception, SystemExit):
        return
    n = len(other.points)
    if not n:
        return
    expect(np.array_equal(mesh.p[:, :n].T, other.points[:, :2]), "positions differ")
    blocks = [x.data.tolist() for x in other.cells if x.type in ("triangle", "quad")]
    cells = {tuple(sorted(cell)) for block in blocks for cell in block}
    expect_equal("cells", {*map(tuple, cells_of(mesh))}, cells)


FAMILIES = tuple(
    Family(name, {"": mesh_files(name)}, attempt, 1500 if "vt" in name else 2500)
    for name in FORMATS
)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_a_damaged_mesh_is_rejected_or_read_correctly(family):
    family.check(12)
