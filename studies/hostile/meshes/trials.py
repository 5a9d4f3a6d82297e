"""Trials of damaged mesh files: refused in one line, or read as a plain reader does."""

import contextlib
import io
import logging
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from skfem import MeshTri

from skfem_textile import MeshError, split
from skfem_textile.io import read_mesh

from ..readers import abaqus, gmsh, vtk_legacy, vtk_xml
from ..readers.mesh_content import MalformedError, MeshContent
from ..trial import RIGHT, SILENT, UNCLEAR, Family, Finding, is_clear, refused
from . import abaqus_writer, gmsh_writer, vtk_writer
from .comparison import difference
from .short_run import run
from .sound_meshes import SoundMesh, sound_mesh
from .text_damage import damaged

#: Files that Gmsh wrote.
MESHES = Path(__file__).parents[3] / "tests" / "io" / "meshes"

_READERS: dict[str, Callable[[bytes], MeshContent]] = {
    ".msh": gmsh.read,
    ".inp": abaqus.read,
    ".vtu": vtk_xml.read,
    ".vtk": vtk_legacy.read,
}

# One in this many files has the suffix of another format, or of none.
_WRONG_SUFFIX = 60
_SUFFIXES = (*_READERS, ".mesh", ".txt", "")

# One in this many meshes is scaled by a power of ten, with an exponent between these.
_ODD_SIZE = 40
_EXPONENTS = (-300, 300)

# Begins what is printed, and warnings that do not go to the log.
_LOUD = "aloud: "

# One in this many meshes that were read is loaded.
_RUN = 2


class _Format(NamedTuple):
    """A format: its suffix, what writes a mesh, and a pattern of files by Gmsh."""

    suffix: str
    write: Callable[[SoundMesh, Generator], bytes]
    by_gmsh: str = ""


_FORMATS = {
    "msh 2.2": _Format(".msh", gmsh_writer.gmsh_22, "*22.msh"),
    "msh 4.1": _Format(".msh", gmsh_writer.gmsh_41, "*41*.msh"),
    "inp": _Format(".inp", abaqus_writer.abaqus, "*.inp"),
    "vtu": _Format(".vtu", vtk_writer.vtu),
    "vtk": _Format(".vtk", vtk_writer.vtk),
}


def family(name: str, trials: int, short: int = 30) -> Family:
    """Trials of one format."""
    return Family(name, partial(_attempt, name), trials, short)


def _attempt(name: str, seed: int, folder: Path) -> Finding:
    """Write a file of a format, damage it, and read it."""
    file_format = _FORMATS[name]
    rng = np.random.default_rng([list(_FORMATS).index(name), seed])
    content, one_kind, odd = _sound_file(file_format, rng)
    content, damage = damaged(content, rng)
    damage += odd
    path = folder / f"mesh{file_format.suffix}"
    if rng.integers(0, _WRONG_SUFFIX) == 0:
        path = folder / f"mesh{rng.choice(_SUFFIXES)}"
        damage += " suffix"
    path.write_bytes(content)
    return _finding(path, not (one_kind and rng.integers(0, 2)), damage, rng)


def _sound_file(file_format: _Format, rng: Generator) -> tuple[bytes, bool, str]:
    """A file of a sound mesh, whether its cells are of one kind, and what is odd."""
    if (pattern := file_format.by_gmsh) and rng.integers(0, 8) == 0:
        return rng.choice(sorted(MESHES.glob(pattern))).read_bytes(), True, ""
    is_vtk = file_format.suffix in (".vtu", ".vtk")
    mesh = sound_mesh(rng, is_vtk and bool(rng.integers(0, 2)))
    odd = ""
    if rng.integers(0, _ODD_SIZE) == 0:
        mesh.points *= 10.0 ** rng.integers(*_EXPONENTS)
        odd = " size"
    return file_format.write(mesh, rng), len(mesh.kinds) == 1, odd


def _finding(path: Path, in_quads: bool, damage: str, rng: Generator) -> Finding:
    """What comes of reading a file, splitting triangles, and of a run on the mesh."""
    with _messages() as messages:
        try:
            mesh = read_mesh(path)
            if in_quads and isinstance(mesh, MeshTri):
                mesh = split(mesh)
        except MeshError as error:
            if messages:
                return Finding(UNCLEAR, damage, messages[0])
            if not damage:
                return Finding(UNCLEAR, damage, f"refused though whole: {error}")
            return refused(damage, str(error))
        all_expected = all(line.startswith(f"{path}: not read: ") for line in messages)
        if len(messages) > 1 or not all_expected or not all(map(is_clear, messages)):
            return Finding(UNCLEAR, damage, " | ".join(messages))
        try:
            content = _READERS[path.suffix](path.read_bytes())
        except MalformedError as error:
            return Finding(SILENT, damage, f"malformed: {error}")
        except KeyError:
            return Finding(SILENT, damage, "no such format")
        if wrong := difference(mesh, content):
            return Finding(SILENT, damage, wrong)
        if rng.integers(0, _RUN) == 0:
            messages.clear()
            try:
                run(mesh)
            except ValueError as error:
                if not damage:
                    return Finding(UNCLEAR, damage, f"no run on a whole: {error}")
                return refused(damage, str(error))
            # A run may write to the log, and nowhere else.
            if loud := [line for line in messages if line.startswith(_LOUD)]:
                return Finding(UNCLEAR, damage, " | ".join(loud))
    return Finding(RIGHT, damage)


@contextlib.contextmanager
def _messages() -> Iterator[list[str]]:
    """Log messages, warnings and prints of a block; prints come last."""
    messages: list[str] = []
    out, handler = io.StringIO(), logging.Handler()
    handler.emit = lambda record: messages.append(record.getMessage())
    logging.getLogger().addHandler(handler)
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(out),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("always")
            warnings.showwarning = lambda text, *_: messages.append(f"{_LOUD}{text}")
            yield messages
    finally:
        logging.getLogger().removeHandler(handler)
        if out.getvalue():
            messages.append(f"{_LOUD}{out.getvalue()!r}")
