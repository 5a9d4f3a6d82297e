"""The case that the options of a run describe."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ..fabric import Fabric, Law
from ..fabric.laws import LAWS
from ..fabric.laws.linear import STIFFNESS
from ..mesh.user_input import printable
from ..ply.formulations import DEFAULT, FORMULATIONS
from ..ply.loads import Force
from ..registration import (
    LawRegistration,
    Option,
    Registration,
    Resistance,
    SceneRegistration,
)
from ..scenes import SCENES
from ..scenes.case import Case
from ..solve.linear import SOLVERS
from ..solve.stepper import DEFAULT_STRATEGIES, DEFAULT_WARN_ONLY, LoadStepper
from ..solve.stepping.adaptive.stepper import MOST_UNKNOWNS, AdaptiveStepper
from ..solve.strategies import STRATEGIES
from ..solve.verdict import CHECKS
from .mesh import mesh_options, scene_of

# What the names of the options of tension and shear laws begin with.
_PREFIXES: dict[Resistance, str] = {"tension": "fibre-", "shear": "shear-"}

# Parameters whose default is another for tension.
_OF_FIBRES = {STIFFNESS: replace(STIFFNESS, default=1e4, metavar="E")}

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
        name="strategy",
        help=f"what a step tries, in this order, of {', '.join(STRATEGIES)}",
        default=list(DEFAULT_STRATEGIES),
        choices=tuple(STRATEGIES),
        metavar="NAME",
        words="+",
    ),
    Option(
        name="warn-only",
        help=f"checks that do not refuse a state, of {', '.join(CHECKS)}",
        default=list(DEFAULT_WARN_ONLY),
        choices=tuple(CHECKS),
        metavar="CHECK",
        words="*",
    ),
    Option(
        name="solver",
        help="linear solver: cholmod needs cvxopt, pardiso pypardiso; auto takes the "
        "fastest that is there, which it measures for large systems",
        default="auto",
        choices=("auto", *SOLVERS),
    ),
)


def options_of(scene: SceneRegistration) -> tuple[Option, ...]:
    """Every option that describes a case of the scene."""
    common = (
        *mesh_options(scene),
        *_formulation_options(),
        *_fabric_options(),
        *_STEPPING,
    )
    defaults = scene.defaults
    return (
        *(replace(o, default=defaults.get(o.name, o.default)) for o in common),
        *scene.options,
    )


def case_of(values: Mapping[str, Any]) -> tuple[Case, dict[str, Any]]:
    """The case that values describe, by the keys of their options.

    Parameters
    ----------
    values
        A value for each of `options_of`, and the name of the ``scene``.

    Returns
    -------
    tuple
        The case, and the values with those filled in that depend on others.

    Raises
    ------
    ValueError
        If they describe none.
    """
    scene, values = scene_of(values)
    tension, shear = _law("tension", values), _law("shear", values)
    chosen = _chosen("formulation", values["formulation"], FORMULATIONS, values)
    return Case(
        scene=scene,
        fabric=Fabric(tension, shear, scene.warp, scene.weft),
        loads=tuple(Force(name, scene.turn @ total) for name, total in values["force"]),
        formulation=chosen(),
        steps=values["steps"],
        strategies=values["strategy"],
        warn_only=values["warn_only"],
        solver=values["solver"],
    ), values


def stepper_of(
    case: Case, values: Mapping[str, Any], checkpoint: Path | None
) -> LoadStepper | AdaptiveStepper:
    """The load stepper of a case, to a tolerance if the values have one.

    Raises
    ------
    ValueError
        As from the steppers, or if there is a tolerance and a checkpoint.
    """
    if values["tolerance"] is None:
        if values["most_unknowns"] != MOST_UNKNOWNS:
            raise ValueError("--most-unknowns goes with --tolerance")
        return case.stepper(checkpoint)
    if checkpoint:
        raise ValueError("--tolerance cannot have a checkpoint: leave one of them out")
    return AdaptiveStepper(
        *(case.ply(), case.scene.conditions, values["tolerance"], case.steps),
        most_unknowns=values["most_unknowns"],
        strategies=case.strategies,
        warn_only=case.warn_only,
        solver=case.solver,
    )


def _formulation_options() -> tuple[Option, ...]:
    names = Option(
        name="formulation",
        help=_described(FORMULATIONS),
        default=DEFAULT.name,
        choices=tuple(FORMULATIONS),
    )
    return names, *_own_options(FORMULATIONS)


def _fabric_options() -> tuple[Option, ...]:
    return (
        *_law_options("tension"),
        *_law_options("shear"),
        Option(
            name="force",
            help="a force in N in all, spread over a named boundary beside the "
            "scene's conditions, in proportion to the load factor; may be repeated",
            default=(),
            read=_force,
            metavar="NAME=FX,FY",
            repeated=True,
        ),
    )


def _laws(of: Resistance) -> dict[str, LawRegistration]:
    """The laws of tension or of shear, by name."""
    laws = {name: law for name, law in LAWS.items() if of in law.resists}
    if of == "shear":
        return laws
    return {
        name: replace(law, options=tuple(_OF_FIBRES.get(o, o) for o in law.options))
        for name, law in laws.items()
    }


def _law_options(of: Resistance) -> tuple[Option, ...]:
    laws = _laws(of)
    law = Option(
        name=f"{of}-law",
        help=_described(laws),
        default="linear",
        read=partial(_law_word, of),
        metavar="LAW",
    )
    return law, *_own_options(laws, _PREFIXES[of])


def _law_name(of: Resistance, word: str) -> str | None:
    """The name of the law that a word is, or that a file of this name has."""
    laws, ends = _laws(of), word.lower().endswith
    files = [law.name for law in laws.values() if law.suffix and ends(law.suffix)]
    return files[0] if files else word if word in laws else None


def _law_word(of: Resistance, word: str) -> str:
    laws, name = _laws(of), _law_name(of, word)
    if name is None:
        raise ValueError(f"{word!r} is none of {', '.join(laws)}")
    if laws[name].suffix and not Path(word).is_file():
        raise ValueError(f"{word!r}: there is no such file")
    return word


def _law(of: Resistance, values: Mapping[str, Any]) -> Law:
    """The law of tension or shear that is chosen."""
    word, laws, prefix = values[f"{of}_law"], _laws(of), _PREFIXES[of]
    name = _law_name(of, word) or word
    build = _chosen(f"{of}-law", name, laws, values, prefix)
    for option in laws[name].options:
        if build.keywords[option.key] is None:
            raise ValueError(f"--{of}-law {name} needs --{prefix}{option.name}")
    if not laws[name].suffix:
        try:
            return build()
        except ValueError as error:
            raise ValueError(f"{of} {error}") from None
    try:
        return build(path=word, of=of)
    except (ValueError, OSError) as error:
        raise ValueError(f"--{of}-law {printable(error)}") from None


def _described(among: Mapping[str, Registration]) -> str:
    return "; ".join(f"{name}: {one.description}" for name, one in among.items())


def _own_options(
    among: Mapping[str, Registration], prefix: str = ""
) -> tuple[Option, ...]:
    """The options that any of them has, their names after a prefix."""
    own = {o.name: o for one in among.values() for o in one.options}
    return tuple(replace(option, name=prefix + name) for name, option in own.items())


def _chosen(
    option: str,
    name: str,
    among: Mapping[str, Registration],
    values: Mapping[str, Any],
    prefix: str = "",
) -> partial[Any]:
    """What builds the one that an option names; refuses the options of others."""
    chosen, defaults = among[name], SCENES[values["scene"]].defaults
    given: dict[str, Any] = {}
    for own in _own_options(among):
        full = replace(own, name=prefix + own.name)
        if own in chosen.options:
            given[own.key] = values[full.key]
        elif values[full.key] != defaults.get(full.name, own.default):
            names = [one.name for one in among.values() if own in one.options]
            raise ValueError(f"--{full.name} goes with --{option} {' or '.join(names)}")
    return partial(chosen.build, **given)


def _force(word: str) -> tuple[str, tuple[float, float]]:
    name, _, components = word.partition("=")
    try:
        x, y = (float(component) for component in components.split(","))
    except ValueError:
        x = math.nan
    if not (name and math.isfinite(x) and math.isfinite(y)):
        raise ValueError(f"{word!r} is not like top=0,100")
    return name, (x, y)
