"""What a case may say, on the command line and in a file.

A case is described by *values*: a mapping with a value for each option, by its key.
The options stand in tables, which are the tables of a case file.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from ...ply.formulations import DEFAULT, FORMULATIONS
from ...registration import Option, SceneRegistration
from ...scenes.common.edge_vectors import FORCES
from ...solve.adaptive import MOST_UNKNOWNS
from ...solve.linear import SOLVERS
from ...solve.newton import METHODS
from ...solve.stepper import DEFAULT_WARN_ONLY
from ...solve.verdict import CHECKS
from ..fibres import DIRECTIONS, FABRIC
from .laws import BENDING, PREFIXES, described, law_table, own_options
from .mesh_options import is_mesh_file, mesh_options, scene_options
from .table import Table

# What of the options of formulations a case file needs to know beside their readers.
_IN_FILE: dict[str, dict[str, Any]] = {
    "cs": {"unit": "N_per_mm", "in_file": float | str},
}


def _names(
    name: str, what: str, among: Iterable[str], metavar: str, words: str
) -> Option:
    """An option that takes some names."""
    names = tuple(among)
    said = f"{what}, of {', '.join(names)}"
    return Option(name=name, help=said, choices=names, metavar=metavar, words=words)


_STEPPING = (
    Option(name="steps", help="load steps", default=20, read=int),
    Option(
        name="tolerance",
        help="refine the mesh where the shear angle jumps until the estimated error of "
        "the load is below this share of it",
        read=float,
        metavar="SHARE",
    ),
    Option(
        name="most-unknowns",
        help="no mesh of a run to a tolerance has more unknowns",
        default=MOST_UNKNOWNS,
        read=int,
        metavar="N",
    ),
    Option(
        name="method",
        help="nonlinear solver: newton, or plain: Newton's method with the consistent "
        "tangent, which needs small steps",
        default="newton",
        choices=tuple(METHODS),
    ),
    replace(
        _names("warn-only", "checks that do not refuse a state", CHECKS, "CHECK", "*"),
        default=list(DEFAULT_WARN_ONLY),
    ),
    Option(
        name="solver",
        help="linear solver: cholmod needs cvxopt, pardiso pypardiso; auto takes the "
        "fastest that is there, which it measures for large systems",
        default="auto",
        choices=("auto", *SOLVERS),
    ),
)

_TEST_CURVE = Option(
    name="test-curve",
    help="a CSV file with the curve of a test, which is drawn beside that of the run",
    metavar="FILE.csv",
    names_file=bool,
)

#: What a run of a ply on a tool hands over to the next analysis, and to the cutter.
HAND_OVER = (
    Option(
        name="part-mesh",
        help="a mesh of the part, whose elements get the fibres of the ply: STL, and "
        "what else meshio reads",
        metavar="FILE",
        names_file=bool,
    ),
    Option(
        name="trim",
        help="a CSV file with the columns x, y and z of a closed curve on the tool, "
        "which trims the flat pattern (default: the boundary of the part)",
        metavar="FILE.csv",
        names_file=bool,
    ),
)

#: Whether pictures are drawn: ``--no-render`` on the command line.
PICTURES = Option(name="pictures", help="draw pictures", default=True, in_file=bool)


def tables_of(scene: SceneRegistration) -> tuple[Table, ...]:
    """The tables of a case of the scene."""
    tables = (
        Table("scene", scene_options(scene)),
        Table(
            *("mesh", (*mesh_options(scene), DIRECTIONS), "source"),
            applies=lambda word, option: (
                option.name == DIRECTIONS.name or not is_mesh_file(word)
            ),
        ),
        Table("fabric", FABRIC, "file", applies=lambda word, option: word is not None),
        *(law_table(of) for of in PREFIXES),
        BENDING,
        _formulation_table(),
        Table("loads", (FORCES,)),
        Table("stepping", _STEPPING),
        Table("output", (_TEST_CURVE, *(HAND_OVER * scene.on_tool), PICTURES)),
    )
    own = {option.name for option in scene.options}

    def of_scene(option: Option) -> Option:
        if option.name in own:
            return option
        default = scene.defaults.get(option.name, option.default)
        return replace(option, default=default)

    def with_defaults(table: Table) -> Table:
        options, parts = map(of_scene, table.options), map(with_defaults, table.parts)
        return replace(table, options=tuple(options), parts=tuple(parts))

    return tuple(map(with_defaults, tables))


def options_of(scene: SceneRegistration) -> tuple[Option, ...]:
    """Every option of the command line that describes a case of the scene."""
    every = [option for table in tables_of(scene) for option in table.options]
    return tuple(option for option in every if option.in_file is not bool)


def _formulation_table() -> Table:
    names = Option(
        name="formulation",
        help=described(FORMULATIONS),
        default=DEFAULT.name,
        choices=tuple(FORMULATIONS),
    )
    own = (replace(o, **_IN_FILE.get(o.name, {})) for o in own_options(FORMULATIONS))

    def applies(chosen: str, option: Option) -> bool:
        return option.name in {one.name for one in FORMULATIONS[chosen].options}

    return Table("formulation", (names, *own), "name", applies=applies)
