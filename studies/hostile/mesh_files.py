"""Mesh files that are damaged: refused in one line, or read as a plain reader does."""

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

from skfem_textile import MeshError
from skfem_textile.io import read_mesh

from . import abaqus_files, gmsh_files, plain_gmsh, plain_inp, plain_vtk, plain_vtu
from . import vtk_files as vtk
from .damage import damaged
from .good_meshes import Good, good_mesh
from .mesh_compared import difference
from .mesh_run import run
from .plain import MalformedError, Plain
from .trial import RIGHT, SILENT, UNCLEAR, Family, Finding, is_clear, refused

#: Files that Gmsh wrote.
MESHES = Path(__file__).parents[2] / "tests" / "io" / "meshes"

_PLAIN: dict[str, Callable[[bytes], Plain]] = {
    ".msh": plain_gmsh.read,
    ".inp": plain_inp.read,
    ".vtu": plain_vtu.read,
    ".vtk": plain_vtk.read,
}

# Of so many files one has the suffix of another format, or of none.
_WRONG_SUFFIX = 60
_SUFFIXES = (*_PLAIN, ".mesh", ".txt", "")

# One in so many meshes is of any size between these powers of ten.
_ODD_SIZE = 40
_EXPONENTS = (-300, 300)

# Begins what is printed, or a warning that is none of the log.
_LOUD = "aloud: "

# Of so many meshes that were read one is run on.
_RUN = 2


class _Format(NamedTuple):
    """A format: its suffix, how a mesh is written, and files that Gmsh wrote."""

    suffix: str
    write: Callable[[Good, Generator], bytes]
    by_gmsh: str = ""


_FORMATS = {
    "msh 2.2": _Format(".msh", gmsh_files.gmsh_22, "*22.msh"),
    "msh 4.1": _Format(".msh", gmsh_files.gmsh_41, "*41*.msh"),
    "inp": _Format(".inp", abaqus_files.abaqus, "*.inp"),
    "vtu": _Format(".vtu", vtk.vtu),
    "vtk": _Format(".vtk", vtk.vtk),
}


def family(name: str, trials: int, short: int = 30) -> Family:
    """Trials of one format."""
    return Family(name, partial(_attempt, name), trials, short)


def _attempt(name: str, seed: int, folder: Path) -> Finding:
    """Write a file of a format, damage it, and read it."""
    form = _FORMATS[name]
    rng = np.random.default_rng([list(_FORMATS).index(name), seed])
    content, one_kind, odd = _good(form, rng)
    content, damage = damaged(content, rng)
    damage += odd
    path = folder / f"mesh{form.suffix}"
    if rng.integers(0, _WRONG_SUFFIX) == 0:
        path = folder / f"mesh{rng.choice(_SUFFIXES)}"
        damage += " suffix"
    path.write_bytes(content)
    return judged(path, not (one_kind and rng.integers(0, 2)), damage, rng)


def _good(form: _Format, rng: Generator) -> tuple[bytes, bool, str]:
    """A file that is right, whether its cells are of one kind, and what is odd."""
    if form.by_gmsh and rng.integers(0, 8) == 0:
        return rng.choice(sorted(MESHES.glob(form.by_gmsh))).read_bytes(), True, ""
    mesh = good_mesh(rng, form.suffix in (".vtu", ".vtk") and bool(rng.integers(0, 2)))
    odd = ""
    if rng.integers(0, _ODD_SIZE) == 0:
        mesh.points *= 10.0 ** rng.integers(*_EXPONENTS)
        odd = " size"
    return form.write(mesh, rng), len(mesh.kinds) == 1, odd


def judged(path: Path, split: bool, damage: str, rng: Generator) -> Finding:
    """What comes of reading a file, and of a run on the mesh."""
    with _heard() as said:
        try:
            mesh = read_mesh(path, split)
        except MeshError as error:
            if said:
                return Finding(UNCLEAR, damage, said[0])
            if not damage:
                return Finding(UNCLEAR, damage, f"refused though whole: {error}")
            return refused(damage, str(error))
        logged = [line for line in said if line.startswith(f"{path}: not read: ")]
        if len(said) > 1 or len(logged) < len(said) or not all(map(is_clear, said)):
            return Finding(UNCLEAR, damage, " | ".join(said))
        try:
            plain = _PLAIN[path.suffix](path.read_bytes())
        except MalformedError as error:
            return Finding(SILENT, damage, f"malformed: {error}")
        except KeyError:
            return Finding(SILENT, damage, "no such format")
        if what := difference(mesh, plain):
            return Finding(SILENT, damage, what)
        if rng.integers(0, _RUN) == 0:
            said.clear()
            try:
                run(mesh)
            except ValueError as error:
                if not damage:
                    return Finding(UNCLEAR, damage, f"no run on a whole: {error}")
                return refused(damage, str(error))
            # A run may log what it thinks of the mesh; nothing else.
            if loud := [line for line in said if line.startswith(_LOUD)]:
                return Finding(UNCLEAR, damage, " | ".join(loud))
    return Finding(RIGHT, damage)


class _Heard(logging.Handler):
    """Keeps messages of the log."""

    def __init__(self, said: list[str]) -> None:
        super().__init__()
        self._said = said

    def emit(self, record: logging.LogRecord) -> None:
        self._said.append(record.getMessage())


@contextlib.contextmanager
def _heard() -> Iterator[list[str]]:
    """What is printed, warned of and logged meanwhile; prints come last."""
    said: list[str] = []
    out, handler = io.StringIO(), _Heard(said)
    logging.getLogger().addHandler(handler)
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(out),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("always")
            warnings.showwarning = lambda message, *_: said.append(f"{_LOUD}{message}")
            yield said
    finally:
        logging.getLogger().removeHandler(handler)
        if out.getvalue():
            said.append(f"{_LOUD}{out.getvalue()!r}")
