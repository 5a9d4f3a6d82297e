"""Fibre directions and fabrics of files on the command line."""

import argparse
import logging
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..fabric import Fabric
from ..fabric.directions import FibreDirections, directions_of, warn_of_directions
from ..mesh.splitting import original_elements
from ..mesh.user_input import printable
from ..registration import Option, angle
from ..solve.surface import OnSurface
from .interruption import held
from .output import complain, say
from .result_folder import ResultFolder

if TYPE_CHECKING:
    from ..scenes import Scene


_DIRECTIONS = "fibre directions of each element, as for `run` (default: those of MESH)"


def add_show(commands: Any) -> None:
    """Add the command to those of a parser."""
    show = commands.add_parser(
        "show", help="draw a mesh and its fibres, and write the directions to files"
    )
    add = show.add_argument
    add("mesh", metavar="MESH", help="a file of quadrilaterals or triangles")
    add("--out", type=Path, required=True, metavar="DIR", help="where files go")
    add("--no-render", action="store_true", help="write no picture")
    add("--directions", metavar="FILE", help=_DIRECTIONS)
    for name in ("warp", "weft"):
        one = angle(name, None, f"angle of the {name} to the x axis in every element")
        add(f"--{name}", type=_number(one.read), metavar="DEG", help=one.help)


def _number(read: Any) -> Any:
    def told(word: str) -> float:
        try:
            return read(word)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return told


log = logging.getLogger(__name__)

_UNITS = "N mm"

# Sine of the angle up to which two directions are the same.  Chosen: above the six
# digits of a deck.
_SAME = 1e-5

#: The option that takes fibre directions.
DIRECTIONS = Option(
    name="directions",
    help="fibre directions of each element: cell data of a .vtu, a .csv, or "
    "the keyword ORIENTATION of an .inp, which may be the mesh file",
    metavar="FILE",
    names_file=bool,
)

#: The options of a fabric, the file first.
FABRIC = (
    Option(
        name="fabric",
        help="all laws: a .json of the package, the keyword FABRIC of an .inp, or "
        "LAW58 or LAW158 of a .rad",
        metavar="FILE",
        names_file=bool,
    ),
    Option(
        name="thickness",
        help="of the ply in mm, for the stresses of a deck (default: of its section)",
        read=float,
        metavar="MM",
        unit="mm",
    ),
    Option(name="units", help="force and length of a deck", default=_UNITS),
    Option(name="material", help="of a deck with several fabrics", metavar="NAME"),
)


def from_files(
    values: Mapping[str, Any],
    scene: "Scene",
    fabric: Fabric,
    laws: Mapping[Option, Any],
) -> tuple["Scene", Fabric]:
    """The scene and its fabric, with what the files say in place of their own.

    Parameters
    ----------
    values
        Values of all options by their keys, and the ``regions``.
    scene, fabric
        As without files.
    laws
        The options of laws with their defaults; beside a fabric none is another.

    Raises
    ------
    ValueError
        If a file is refused, or options contradict each other.
    """
    for name in ("fabric", "directions"):
        if values[name] is not None and values["regions"]:
            raise ValueError(
                f"--{name} is of the whole ply, but regions have their own: leave "
                "one of them out"
            )
    stated = None
    if values["fabric"] is not None:
        _refuse_laws(values, laws)
        from ..io import read_fabric

        told = (values[name] for name in ("thickness", "units", "material"))
        stated = read_fabric(values["fabric"], *told).fabric
        fabric = replace(stated, warp=scene.warp, weft=scene.weft)
    else:
        for option in FABRIC[1:]:
            if values[option.key] != option.default:
                raise ValueError(f"--{option.name} goes with --fabric")
    if values["directions"] is not None:
        scene, fabric = _with_directions(values["directions"], scene, fabric)
    if stated is not None and _has_other_directions(stated, scene, fabric):
        _tell_other_directions(values)
    return scene, fabric


def _with_directions(
    file: str, scene: "Scene", fabric: Fabric
) -> tuple["Scene", Fabric]:
    """The scene and its fabric, with the fibre directions of a file."""
    from ..io import read_directions

    if any(isinstance(one, OnSurface) for one in scene.conditions.values()):
        raise ValueError(
            f"--directions: the fibres of the scene {scene.name} are those of --fibres"
        )
    given = read_directions(file)
    turned = FibreDirections(scene.turn @ given.warp, scene.turn @ given.weft)
    try:
        warn_of_directions(scene.mesh, turned)
    except ValueError as error:
        raise ValueError(f"--directions {printable(file)}: {error}") from None
    misfit = scene.misfit or f"fibre directions are those of {printable(file)}"
    return replace(scene, misfit=misfit), turned.on(fabric)


def _has_other_directions(stated: Fabric, scene: "Scene", taken: Fabric) -> bool:
    """Whether a file states directions that are not those of a run."""
    if stated.warp is Fabric.warp and stated.weft is Fabric.weft:
        return False  # a deck without orientations states none
    try:
        own, used = (directions_of(scene.mesh, one) for one in (stated, taken))
    except ValueError:  # of another number of elements
        return True
    for A, B in (own.warp, used.warp), (own.weft, used.weft):
        x, y = scene.turn @ A
        if np.abs(x * B[1] - y * B[0]).max() > _SAME:
            return True
    return False


def _tell_other_directions(values: Mapping[str, Any]) -> None:
    file, other = values["fabric"], values["directions"]
    source = "the scene's" if other is None else f"those of {printable(other)}"
    how = (
        "write_directions makes a file of them for --directions"
        if Path(file).suffix.lower() == ".json"
        else "to take them give the file as --directions too"
    )
    log.warning(
        "%s: its fibre directions are not taken, %s are: %s",
        printable(file),
        source,
        how,
    )


def _refuse_laws(values: Mapping[str, Any], laws: Mapping[Option, Any]) -> None:
    for option, default in laws.items():
        if values[option.key] != default:
            raise ValueError(
                f"--{option.name} is of a law, but --fabric names a file that has all: "
                "leave one of them out"
            )


_PICTURE = "mesh_and_fibres.png"
_FILES = ("directions.vtu", "directions.csv", "directions.inp")


def show(options: argparse.Namespace) -> int:
    """Draw a mesh and its fibres, and write the directions; returns the exit code.

    Raises
    ------
    ValueError
        If a file is refused, or options contradict each other.
    OSError, OutputError
        If the folder cannot be written.
    """
    from ..io import OF_DIRECTIONS, read_mesh, write_directions

    own = options.warp is None and options.directions in (None, options.mesh)
    mesh = read_mesh(options.mesh, OF_DIRECTIONS if own else ())
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
    _tell(mesh, directions)
    say(f"directions in {printable(options.out)}")
    return 0


def _directions(options: argparse.Namespace, n_elements: int) -> FibreDirections:
    from ..io import read_directions

    angles = options.warp, options.weft
    if (angles[0] is None) != (angles[1] is None):
        raise ValueError("--warp and --weft go together")
    if angles[0] is not None and options.directions is not None:
        raise ValueError("--warp and --directions: leave one of them out")
    if angles[0] is not None:
        return FibreDirections.of_angles(*(np.full(n_elements, a) for a in angles))
    file = options.directions or options.mesh
    found = read_directions(file)
    if (n := found.warp.shape[1]) != n_elements:
        raise ValueError(f"{printable(file)}: {n} directions for {n_elements} elements")
    return found


def _draw(mesh: Any, directions: FibreDirections, out: Path) -> None:
    """Draw the picture, or print in one line why not: the files are already written."""
    try:
        with held(), ResultFolder(out, (_PICTURE,)) as folder:
            from ..plot import mesh_and_fibres

            mesh_and_fibres(mesh, directions, filename=folder / _PICTURE)
    except Exception as error:
        complain(f"no picture: {printable(error)}")


def _tell(mesh: Any, directions: FibreDirections) -> None:
    warp, weft = directions.angles_deg()
    between = np.abs((weft - warp + 90) % 180 - 90)
    for name, shown in (
        ("elements", f"{len(warp)}"),
        ("warp_angle_deg", f"{warp.min():.6g} to {warp.max():.6g}"),
        ("weft_angle_deg", f"{weft.min():.6g} to {weft.max():.6g}"),
        ("angle_between_deg", f"{between.min():.6g} to {between.max():.6g}"),
        ("boundaries", ", ".join(map(printable, mesh.boundaries or {})) or "none"),
    ):
        say(f"{name:34}{shown}")
