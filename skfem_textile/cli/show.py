"""The command ``show``: draw a mesh and its fibres, or the laws of a fabric."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from ..fabric.directions import FibreDirections, warn_of_directions
from ..io import OF_DIRECTIONS, read_directions, read_mesh, write_directions
from ..mesh.splitting import original_elements
from ..mesh.user_input import printable
from .fabric import show_fabric
from .interruption import held
from .output import complain, say
from .result_folder import ResultFolder

# Suffixes of fabrics; names in the catalogue have none.
_OF_FABRICS = "", ".json"

_PICTURE = "mesh_and_fibres.png"
_FILES = ("directions.vtu", "directions.csv", "directions.inp")


def run(options: argparse.Namespace) -> int:
    """Draw a mesh and its fibres, and write the directions; returns the exit code.

    A name without a suffix, or of a .json file, is a fabric.

    Raises
    ------
    ValueError
        If a file is refused, or options contradict each other.
    OSError, OutputError
        If the folder cannot be written.
    """
    if Path(options.mesh).suffix.lower() in _OF_FABRICS:
        return show_fabric(options)
    if options.out is None:
        raise ValueError("--out is missing: name a folder for picture and directions")
    in_mesh = options.warp is None and options.directions in (None, options.mesh)
    mesh = read_mesh(options.mesh, OF_DIRECTIONS if in_mesh else ())
    directions = _directions(
        options, sum(c.shape[1] for c in original_elements(mesh)[0])
    )
    warn_of_directions(mesh, directions)
    results = ResultFolder(options.out, (*_FILES, _PICTURE))
    with held(), results as folder:
        for name in _FILES:
            write_directions(folder / name, mesh, directions)
    if not options.no_render:
        _draw(mesh, directions, options.out)
    _print_figures(mesh, directions)
    say(f"directions written to {printable(options.out)}{results.removed_text()}")
    return 0


def _directions(options: argparse.Namespace, n_elements: int) -> FibreDirections:

    angles = options.warp, options.weft
    if (angles[0] is None) != (angles[1] is None):
        raise ValueError("--warp and --weft must be given together")
    if angles[0] is not None and options.directions is not None:
        raise ValueError(
            "--directions cannot be combined with --warp and --weft: omit one of them"
        )
    if angles[0] is not None:
        return FibreDirections.of_angles(*(np.full(n_elements, a) for a in angles))
    file = options.directions or options.mesh
    directions = read_directions(file)
    if (n := directions.warp.shape[1]) != n_elements:
        raise ValueError(
            f"{printable(file)} has fibre directions for {n} elements, but the mesh "
            f"has {n_elements} elements"
        )
    return directions


def _draw(mesh: Any, directions: FibreDirections, out: Path) -> None:
    """Draw the picture, or print the reason why not; the files are already written."""
    try:
        with held(), ResultFolder(out, (_PICTURE,)) as folder:
            from ..plot import mesh_and_fibres

            mesh_and_fibres(mesh, directions, filename=folder / _PICTURE)
    except Exception as error:
        complain(f"the picture was not drawn: {printable(error)}")


def _print_figures(mesh: Any, directions: FibreDirections) -> None:
    warp, weft = directions.angles_deg()
    between = np.abs((weft - warp + 90) % 180 - 90)
    for name, text in (
        ("elements", f"{len(warp)}"),
        ("warp_angle_deg", f"{warp.min():.6g} to {warp.max():.6g}"),
        ("weft_angle_deg", f"{weft.min():.6g} to {weft.max():.6g}"),
        ("angle_between_deg", f"{between.min():.6g} to {between.max():.6g}"),
        ("boundaries", ", ".join(map(printable, mesh.boundaries or {})) or "none"),
    ):
        say(f"{name:34}{text}")
