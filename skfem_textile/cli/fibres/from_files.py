"""The options that take fibre directions and a fabric from files."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...fabric import Fabric
from ...fabric.directions import FibreDirections, warn_of_directions
from ...mesh.user_input import printable
from ...registration import Option

if TYPE_CHECKING:
    from ...scenes import Scene

_UNITS = "N mm"

#: The option that takes fibre directions.
DIRECTIONS = Option(
    name="directions",
    help="fibre directions of each element: cell data of a .vtu, a .csv, or "
    "*ORIENTATION of an .inp, which may be the mesh file",
    metavar="FILE",
    names_file=bool,
)

#: The options of a fabric, the file first.
FABRIC = (
    Option(
        name="fabric",
        help="all laws: a .json of the package, *FABRIC of an .inp, or LAW58 or LAW158 "
        "of a .rad",
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
    if values["fabric"] is not None:
        _refuse_laws(values, laws)
        from ...io import read_fabric  # loads meshio

        told = (values[name] for name in ("thickness", "units", "material"))
        found = read_fabric(values["fabric"], *told).fabric
        fabric = replace(found, warp=scene.warp, weft=scene.weft)
    else:
        for option in FABRIC[1:]:
            if values[option.key] != option.default:
                raise ValueError(f"--{option.name} goes with --fabric")
    if values["directions"] is None:
        return scene, fabric
    from ...io import read_directions

    file = printable(values["directions"])
    given = read_directions(values["directions"])
    turned = FibreDirections(scene.turn @ given.warp, scene.turn @ given.weft)
    try:
        warn_of_directions(scene.mesh, turned)
    except ValueError as error:
        raise ValueError(f"--directions {file}: {error}") from None
    misfit = scene.misfit or f"fibre directions are those of {file}"
    return replace(scene, misfit=misfit), turned.on(fabric)


def _refuse_laws(values: Mapping[str, Any], laws: Mapping[Option, Any]) -> None:
    for option, default in laws.items():
        if values[option.key] != default:
            raise ValueError(
                f"--{option.name} is of a law, but --fabric names a file that has all: "
                "leave one of them out"
            )
