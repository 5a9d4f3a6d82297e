"""Trials of damaged decks: refused in one line, or read as they stand."""

import contextlib
import io
from pathlib import Path

import numpy as np
from numpy.random import Generator

from skfem_textile import Fabric, MeshError
from skfem_textile.cli import main as cli
from skfem_textile.fabric.directions import FibreDirections
from skfem_textile.io import read_directions, read_fabric, write_fabric

from ...common.running import errors_only
from ..meshes.text_damage import damaged
from ..trial import (
    UNCLEAR,
    Family,
    Finding,
    WrongAnswerError,
    checked,
    is_clear,
    refused,
)
from . import plain_reader, sound_decks, tables

# Thickness that is told, in mm.
_THICKNESS = 0.25

# Agreement of two readers of the same numbers: round-off, of sums of large numbers too.
_ROUND_OFF = 1e-9

# One in this many decks of Abaqus is shown on the command line.
_SHOWN = 6

_FILES = {"directions.vtu", "directions.csv", "directions.inp"}


def _attempt_abaqus(seed: int, folder: Path) -> Finding:
    """Read directions and fabric of a damaged deck of Abaqus."""
    rng = np.random.default_rng([58, seed])
    content, damage = damaged(sound_decks.abaqus(rng), rng)
    path = folder / "deck.inp"
    path.write_bytes(content)
    if rng.integers(0, _SHOWN) == 0:
        return _shown(path, damage, folder)
    found: list[object] = []
    for read in (read_directions, _fabric_of):
        finding = _read(read, path, damage, found)
        if finding:
            return finding
    return checked(damage, _check_abaqus, found, content, folder)


def _attempt_radioss(seed: int, folder: Path) -> Finding:
    """Read the fabric of a damaged deck of OpenRadioss."""
    rng = np.random.default_rng([158, seed])
    content, damage = damaged(sound_decks.radioss(rng), rng)
    path = folder / "deck.rad"
    path.write_bytes(content)
    found: list[object] = []
    if finding := _read(_fabric_of, path, damage, found):
        return finding
    return checked(damage, _check_laws, found[0], rng, folder)


def _fabric_of(path: Path) -> Fabric:
    found = read_fabric(path, _THICKNESS)
    if not all(map(is_clear, found.not_taken)):
        raise WrongAnswerError(f"not said in a line: {found.not_taken}")
    return found.fabric


def _read(read, path: Path, damage: str, found: list[object]) -> Finding | None:
    """Read a deck; the finding if it is refused."""
    try:
        with errors_only():
            found.append(read(path))
    except MeshError as error:
        if not damage:
            return Finding(UNCLEAR, damage, f"refused though whole: {error}")
        return refused(damage, str(error))
    return None


def _check_abaqus(found: list, content: bytes, folder: Path) -> None:
    directions, fabric = found
    _check_points(fabric, content)
    _check_directions(directions, content)
    _check_written(fabric, folder)


def _check_points(fabric: Fabric, content: bytes) -> None:
    """Raise unless every point of the loading data is on its law."""
    tables = plain_reader.loading_data(content)
    laws = dict(zip(("2", "1", "SHEAR"), fabric.laws, strict=True))
    for component, points in tables.items():
        strain, stress = np.array(points).T
        x = strain if component == "SHEAR" else np.log1p(strain)
        scale = 1.0 if component == "SHEAR" else 1 + strain
        expected = _THICKNESS * scale * stress
        inner = getattr(laws[component], "law", laws[component])  # in tension only
        if component == "SHEAR" and (strain < 0).any() and (strain > 0).any():
            x, expected = -x, -expected
        value = inner.value(x)
        if not np.allclose(value, expected, rtol=_ROUND_OFF, atol=1e-300):
            raise WrongAnswerError(f"{component}: {value} instead of {expected}")


def _check_directions(directions: FibreDirections, content: bytes) -> None:
    """Raise unless the weft is along the first axes."""
    elements = plain_reader.element_numbers(content)
    axes = plain_reader.first_axes(content, elements)
    weft = directions.weft / np.hypot(*directions.weft)
    if axes is not None and not np.allclose(weft, axes, atol=1e-5):
        raise WrongAnswerError(f"weft {weft} instead of {axes}")


def _check_laws(fabric: Fabric, rng: Generator, folder: Path) -> None:
    """Raise unless laws vanish at rest and their values are slopes of the energy."""
    rest = np.zeros((2, 1))
    if not np.abs(fabric.tensions.value(rest)).max() < 1e-9:
        raise WrongAnswerError("tension at rest")
    if not abs(fabric.shear_law.value(np.zeros(1))[0]) < 1e-9:
        raise WrongAnswerError("moment at rest")
    step, strain = 1e-6, rng.uniform(0.0, 0.03, (2, 3))
    tension = np.array(fabric.tensions.value(strain))
    for i in range(2):
        moved = step * np.eye(2)[:, [i]]
        ahead, behind = (fabric.tensions.energy(strain + s * moved) for s in (1, -1))
        slope = (ahead - behind) / (2 * step)
        if not np.allclose(
            slope, tension[i], rtol=1e-3, atol=1e-4 * np.abs(tension).max()
        ):
            raise WrongAnswerError(f"slope {slope} of the energy, tension {tension[i]}")
    _check_written(fabric, folder)


def _check_written(fabric: Fabric, folder: Path) -> None:
    """Raise unless the fabric comes back from its file."""
    path = folder / "fabric.json"
    write_fabric(path, fabric)
    again = read_fabric(path).fabric
    if repr((again.tensions, again.shear_law)) != repr(
        (fabric.tensions, fabric.shear_law)
    ):
        raise WrongAnswerError("another fabric came back")


def _shown(path: Path, damage: str, folder: Path) -> Finding:
    """Show a deck on the command line: all files, or none and one line."""
    out, printed, told = folder / "out", io.StringIO(), io.StringIO()
    line = ["show", str(path), "--no-render", "--out", str(out)]
    with (
        errors_only(),
        contextlib.redirect_stdout(printed),
        contextlib.redirect_stderr(told),
    ):
        code = cli.main(line)
    names = {file.name for file in out.iterdir()} if out.exists() else set()
    message = told.getvalue().removesuffix("\n")
    if code == 2 and not out.exists() and not printed.getvalue():
        if not damage:
            return Finding(UNCLEAR, damage, f"refused though whole: {message}")
        return refused(damage, message)
    if code == 0 and names == _FILES:
        return checked(damage, lambda: None)
    return Finding(UNCLEAR, damage, f"code {code}, {sorted(names)}: {message}")


FAMILIES = (
    Family("deck inp", _attempt_abaqus, 3000, 30),
    Family("deck rad", _attempt_radioss, 2000, 30),
    tables.FAMILY,
)
