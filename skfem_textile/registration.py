"""What can be chosen by name, declared in the file that defines it.

A scene, a law, a formulation or a linear solver is one file of its folder, with a
constant ``REGISTRATION``.  The command line is built from what `registered` finds.
"""

import math
import pkgutil
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal, TypeAlias, TypeVar

#: Largest angle.  So far from zero it still has ten decimals; at 1e17 a turn by 45 is
#: lost.
MOST_DEGREES = 36_000.0


@dataclass(frozen=True, kw_only=True)
class Option:
    """A value that a user may give, by the name of the option.

    Attributes
    ----------
    name
        Its name in words with hyphens: ``shear-angle`` is ``--shear-angle`` on the
        command line, and ``shear_angle`` among the values.
    help
        What it is, for the command line's help.
    default
        The value where none is given.
    read
        Makes a value of a word; a ValueError says what is wrong with the word.
    choices
        The words that are allowed; empty where all are.
    metavar
        What stands for the value in the help.
    words
        How many words it takes, as ``nargs`` of `argparse`; empty for one.
    repeated
        Whether it may be given several times, which makes a list.
    unit
        Its unit, as the end of its key in a case file, such as ``N_per_mm``.
    in_file
        The type of its value in a case file, where it is not what ``read`` or ``words``
        tell.  A mapping stands for a list of pairs.
    names_file
        Whether a word is the name of a file; None where it never is.
    """

    name: str
    help: str
    default: Any = None
    read: Callable[[str], Any] = str
    choices: tuple[str, ...] = ()
    metavar: str | None = None
    words: str | int = ""
    repeated: bool = False
    unit: str = ""
    in_file: Any = None
    names_file: Callable[[str], bool] | None = None

    @property
    def key(self) -> str:
        """Its name among the values."""
        return self.name.replace("-", "_")


@dataclass(frozen=True, kw_only=True)
class Registration:
    """Something that can be chosen by name.

    Attributes
    ----------
    name
        Its name on the command line.
    description
        One line for the command line's help.
    build
        Makes it; called with the values of its options by their keys.
    options
        The options that are its own.
    rank
        Its place in lists: the smallest comes first.
    """

    name: str
    description: str
    build: Callable[..., Any]
    options: tuple[Option, ...] = ()
    rank: int = 0


@dataclass(frozen=True, kw_only=True)
class SceneRegistration(Registration):
    """A scene that can be chosen by name.

    ``build`` makes the scene: beside the values of the scene's own options it takes a
    ``mesh``, which is a mesh or the kind of one to make, and of one to make
    its ``size``, ``jitter`` and ``seed``.

    Attributes
    ----------
    size, jitter
        Of the mesh to make, where they are not given.
    defaults
        Values of options that are not its own, by the names of the options, where they
        are to be other than those of other scenes.
    dimension
        Components of the displacement, 3 of a ply in space.  Problems in the plane can
        be turned.
    on_tool
        Whether the ply lies on a tool.
    """

    size: tuple[int, int]
    jitter: float = 0.3
    defaults: Mapping[str, Any] = field(default_factory=dict)
    dimension: int = 2
    on_tool: bool = False


#: What a law may be the law of.
Resistance: TypeAlias = Literal["tension", "shear"]


@dataclass(frozen=True, kw_only=True)
class LawRegistration(Registration):
    """A law that can be chosen by name.

    Its options are its parameters, without the word that tells which law they are of:
    the option ``stiffness`` of a shear law is ``--shear-stiffness``.

    Attributes
    ----------
    resists
        What it may be the law of.
    suffix
        Where it is read from a file, how the file's name ends: that name stands for the
        law's own.  ``build`` then takes, beside the options, the ``path`` of the file
        and what it is the law ``of``.
    """

    resists: tuple[Resistance, ...] = ("tension", "shear")
    suffix: str = ""


@dataclass(frozen=True, kw_only=True)
class FormulationRegistration(Registration):
    """A formulation that can be chosen by name."""


@dataclass(frozen=True, kw_only=True)
class SolverRegistration(Registration):
    """A linear solver that can be chosen by name; the fastest known has the least rank.

    ``build`` is its class.

    Attributes
    ----------
    module
        What it needs to import, which is done when a system is to be solved with it.
    unknowns
        Number of unknowns from which the time to import that is repaid.
    rival
        Whether it may be the fastest for large systems.
    """

    build: type[Any]
    module: str
    unknowns: int
    rival: bool

    @property
    def package(self) -> str:
        """The package that it needs."""
        return self.module.partition(".")[0]


_Kind = TypeVar("_Kind", bound=Registration)


def registered(package: str, kind: type[_Kind]) -> dict[str, _Kind]:
    """What the modules of a package register, by name, in the order of the ranks.

    Parameters
    ----------
    package
        Name of the package, all modules of which and of its folders are imported.
    kind
        The class of the registrations.

    Raises
    ------
    ValueError
        If two modules register the same name.
    """
    found: dict[str, _Kind] = {}
    path = sys.modules[package].__path__
    for module in pkgutil.walk_packages(path, f"{package}."):
        imported = import_module(module.name)
        registration = getattr(imported, "REGISTRATION", None)
        if not isinstance(registration, kind):
            continue
        if registration.name in found:
            raise ValueError(f"{package}: {registration.name!r} is registered twice")
        found[registration.name] = registration
    ordered = sorted(found.values(), key=lambda one: (one.rank, one.name))
    return {one.name: one for one in ordered}


def angle(name: str, default: float | None, help: str) -> Option:  # noqa: A002
    """An option that is an angle in degrees."""
    return Option(
        name=name,
        help=help,
        default=default,
        read=_degrees,
        metavar="DEG",
        unit="deg",
        in_file=float,
    )


def _degrees(word: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{word!r} is no finite number")
    if abs(number) > MOST_DEGREES:
        raise ValueError(f"{word!r} is more than a hundred turns")
    return number
