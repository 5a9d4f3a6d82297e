"""Input and output of fabrics, for all formats."""

import logging
import os
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..fabric import Fabric
from ..fabric.files import fabric_of_text, fabric_text
from ..mesh.checks import MeshError
from ..mesh.user_input import printable
from . import abaqus_fabric, radioss
from .directions import directions_of_deck
from .file_numbers import errors_about

log = logging.getLogger(__name__)

#: Names for ``others`` of `read_mesh`, of data that `read_fabric` reads or reports.
OF_FABRICS = tuple(f"*{keyword}" for keyword in abaqus_fabric.KEYWORDS)

# Suffixes of fabric files.
_SUFFIXES = (".json", ".inp", ".rad")

# Units in N or mm.
_FORCES = {"N": 1.0, "kN": 1e3}
_LENGTHS = {"mm": 1.0, "cm": 10.0, "m": 1e3}


class FabricOfFile(NamedTuple):
    """Fabric read from a file, and messages about ignored data.

    ``fabric`` has laws in N/mm, and directions if the file defines them.  ``ignored``
    has one message per ignored feature of the file.
    """

    fabric: Fabric
    ignored: tuple[str, ...]


def read_fabric(
    path: str | os.PathLike[str],
    thickness: float | None = None,
    units: str = "N mm",
    material: str | None = None,
) -> FabricOfFile:
    """Read a fabric from a .json, an Abaqus .inp or an OpenRadioss .rad file.

    A warning in the log ``skfem_textile`` reports each ignored feature.

    Parameters
    ----------
    path
        The file.
    thickness
        Thickness of the ply in mm, which converts stress to force per width.  By
        default the thickness of the section of the material in an Abaqus deck.
    units
        Units of force and length in a deck.
    material
        Name, or number in OpenRadioss, of the material, if there are several.

    Returns
    -------
    FabricOfFile
        The fabric, and messages about ignored data.

    Raises
    ------
    MeshError
        If the file cannot be read or does not contain a fabric; one line names the
        file.

    Examples
    --------
    >>> path = getfixture("tmp_path") / "fabric.json"
    >>> write_fabric(path, Fabric(1e4, 0.5, warp=(1, 1), weft=(-1, 1)))
    >>> read_fabric(path).fabric.families[0].tension
    Linear(stiffness=10000.0)
    """
    path = Path(path)
    with errors_about(path):
        result = _read(path, thickness, units, material)
    for sentence in result.ignored:
        log.warning("%s: not represented exactly: %s", printable(path), sentence)
    return result


def _read(
    path: Path, thickness: float | None, units: str, material: str | None
) -> FabricOfFile:
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise MeshError(f"fabrics can be read only from {', '.join(_SUFFIXES)} files")
    force, length = _units(units)
    if thickness is not None and not (np.isfinite(thickness) and thickness > 0):
        raise MeshError(f"the thickness must be positive, got {thickness} mm")
    content = path.read_bytes()
    if suffix == ".json":
        if thickness is not None or material is not None:
            raise MeshError(
                "a .json file does not need a thickness or a material: omit them"
            )
        return FabricOfFile(fabric_of_text(content), ())
    stress = force / length**2
    if suffix == ".rad":
        fabric, ignored = radioss.read(content, thickness, stress, material)
    else:
        fabric, ignored = abaqus_fabric.read(
            content, thickness, length, stress, material
        )
        if directions := directions_of_deck(content):
            fabric = replace(fabric, warp=directions[0], weft=directions[1])
    return FabricOfFile(fabric, tuple(ignored))


def _units(words: str) -> tuple[float, float]:
    """Units of force and length of a deck, in N and mm."""
    force, _, length = words.strip().partition(" ")
    length = length.strip()
    if force not in _FORCES or length not in _LENGTHS:
        raise MeshError(
            f"units must be a force ({', '.join(_FORCES)}) and a length "
            f"({', '.join(_LENGTHS)}), such as 'N mm', got {words!r}"
        )
    return _FORCES[force], _LENGTHS[length]


def write_fabric(
    path: str | os.PathLike[str],
    fabric: Fabric,
    thickness: float | None = None,
    name: str = "FABRIC",
) -> None:
    """Write a fabric, lossless to .json or as an Abaqus material to .inp.

    A .inp contains only the laws, in N and mm; a law that is not tabulated is written
    as 1001 points, up to a strain of 0.1 or an angle of 80°.  Directions are written by
    `write_directions`.

    Parameters
    ----------
    path
        The file.
    fabric
        The fabric.
    thickness
        Thickness of the ply in mm, for a .inp.
    name
        Name of the material in a .inp.

    Raises
    ------
    ValueError
        If the format cannot express the fabric, a thickness is missing, or the name
        has another suffix.
    OSError
        If the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".json":
        text = fabric_text(fabric)
    elif suffix != ".inp":
        raise ValueError(f"{path}: fabrics can be written only to .json, .inp files")
    elif thickness is None or not (np.isfinite(thickness) and thickness > 0):
        raise ValueError(
            f"{path}: *FABRIC requires the thickness of the ply in mm, got {thickness}"
        )
    else:
        text = abaqus_fabric.material_of(fabric, thickness, name)
    path.write_text(text, encoding="utf-8")
