"""Options of the command ``run``, generated from the declaration of a case."""

import argparse
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from msgspec import Struct

from ..cases.read import (
    CaseFile,
    CaseFileError,
    declared,
    read_tables,
    varied,
    with_value,
)
from ..cases.scenes import SCENES, Scene
from ..cases.tables import (
    FILE,
    about,
    named,
    summary_of,
)
from ..cases.write import key_help, meaning, tables_of
from ..declarations import words
from ..declarations.scenes import AnyScene, Specimen, WithTools
from ..declarations.words import Options, option
from ..mesh.user_input import errors_in, printable
from .options import OUTPUTS, add
from .output import say

# Options for common keys, in addition to the keys of the scene.
_OPTIONS = {
    "mesh": "mesh.source",
    "density": "mesh.density",
    "size": "mesh.size",
    "mesh-as-is": "mesh.as_is",
    "directions": "mesh.directions",
    "fabric": "fabric.file",
    "samples": "fabric.samples",
    "tension-law": "tension.law",
    "fibre-stiffness": "tension.stiffness_N_per_mm",
    "shear-law": "shear.law",
    "shear-stiffness": "shear.stiffness_N_per_mm",
    "formulation": "formulation.name",
    "force": "loads.force_N",
    "steps": "stepping.steps",
    "programme": "stepping.programme",
    "release": "stepping.release",
    "tolerance": "stepping.tolerance",
    "solver": "stepping.solver",
    "test-curve": "output.test_curve",
}
_OPTIONS_OF_OUTLINES = {key: f"mesh.{key}" for key in ("outline", "unit", "layer")}
_OPTIONS_WITH_TOOLS = {
    "part-mesh": "output.part_mesh",
    "deck": "output.deck",
    "thickness": "output.thickness_mm",
    "material": "output.material",
    "calculix": "output.calculix",
    "part-reach": "output.part_reach_mm",
    "trim": "output.trim",
    "pattern": "output.pattern",
}

_SET: Options = {
    "--set": option(
        "set any key of a case file, such as stepping.method=plain",
        words.setting,
        "KEY=VALUE",
        action="extend",
        nargs="+",
        default=[],
    ),
}


def _processes(of: str, runs: str) -> Options:
    """Options of the processes of several runs."""
    return {
        "--workers": option(
            f"number of processes{of} (default: one for each processor)",
            words.count,
            "N",
        ),
        "--scheduler": option(
            f"address of a dask scheduler that distributes the {runs}, such as "
            "tcp://machine:8786",
            metavar="ADDRESS",
        ),
    }


# Options of a sweep, besides the keys of its case.
_OF_SWEEP: Options = {
    "--vary": option(
        "values of any key of a case file, such as scene.fibres_deg=0,45; all "
        "combinations are run",
        words.variation,
        "KEY=VALUE,VALUE",
        action="extend",
        nargs="+",
        default=[],
    ),
    **_SET,
    **_processes("", "runs"),
}

# Options of a run, besides the keys of its case.
_OF_RUN: Options = {
    **_SET,
    "--checkpoint": option(
        "write every converged step to a checkpoint (default folder: `checkpoint` in "
        "DIR)",
        words.folder,
        "FOLDER",
        nargs="?",
        const=True,
    ),
    "--resume": option(
        "resume an interrupted run from its checkpoint, and continue to write it",
        words.folder,
        "FOLDER",
        nargs="?",
        const=True,
    ),
    "--from": option(
        "repeat a process from --phase on with other values: the states before are "
        "taken from the checkpoint of the run in FOLDER, which is not changed",
        words.folder,
        "FOLDER",
        dest="states_of",
    ),
    "--phase": option(
        "name of the phase with which a run --from another begins", metavar="NAME"
    ),
    **_processes(" for --samples", "samples"),
    "--json": option(
        "print summary.json instead of the first quantities", action="store_true"
    ),
}

# Keys whose value is a mesh, a law or a file name.
_NAME_OR_FILE = ("mesh.source", "tension.law", "shear.law")

# A key of a case in a message, not as the value of --set.
_KEY = re.compile(r"(?<!--set )(?<![\w./])[a-z]+\.\w+(?![\w./])")

# Options of scene keys that differ from the key without its unit.
_RENAMED = {"warp_deg": "fibres"}

_EXIT_CODES_OF_SWEEP = (
    "exit code: 0 if every run applied the whole load; 1 if runs stopped early or were "
    "refused, or the results cannot be written; 2 for invalid input (nothing is run); "
    "130 if interrupted (finished runs are kept, and the same command continues)"
)

_EXIT_CODES = (
    "exit code: 0 if every step converged; 1 if the run stopped early (the last "
    "converged state is written) or the results cannot be written; 2 for invalid input "
    "(nothing is written); 130 if interrupted by Ctrl-C or SIGTERM (the last converged "
    "state is written)"
)


def add_run(
    parser: argparse.ArgumentParser, named: Sequence[str] | None, is_sweep: bool = False
) -> None:
    """Add the scenes; values of case keys are stored by the path of the key.

    Parameters
    ----------
    parser
        Parser of the command.
    named
        Scene or case file; only this scene gets its options. All scenes if None.
    is_sweep
        True for a sweep instead of a run.
    """
    others = _OF_SWEEP if is_sweep else _OF_RUN
    epilog = _EXIT_CODES_OF_SWEEP if is_sweep else _EXIT_CODES
    scenes = parser.add_subparsers(dest="scene", required=True)
    for name, scene in SCENES.items():
        is_named = named is None or name in named[:1]
        used = scene if is_named else None
        _add_scene(scenes, name, summary_of(scene), used, others, epilog=epilog)
    files = [word for word in (named or ())[:1] if words.is_case_file(word)]
    about_file = words.CASE_FILE, "a case file", None
    _add_scene(scenes, *about_file, others, aliases=files, epilog=epilog)


def add_exports(parser: argparse.ArgumentParser, others: Options) -> None:
    """Add the options of a command, and missing ones of exports."""
    add(parser, others)
    exports = {f: p for f, p in _OPTIONS_WITH_TOOLS.items() if f"--{f}" not in others}
    flags = _add_keys(parser, exports, get_type_hints(CaseFile), {})
    parser.set_defaults(flags={**flags, "mesh.unit": "--outline-unit"})


@contextmanager
def typed(options: argparse.Namespace) -> Iterator[None]:
    """Let errors have the options that were typed, or exist, in place of case keys."""
    try:
        yield
    except ValueError as error:
        given = *getattr(options, "set", ()), *getattr(options, "vary", ())
        by_key = {path for path, _ in given}
        flags = {k: f for k, f in options.flags.items() if k not in by_key}
        text = _KEY.sub(lambda found: flags.get(found[0], found[0]), str(error))
        raise ValueError(text) from None


def _add_scene(
    scenes: Any,
    name: str,
    summary: str,
    scene: type[Scene] | None,
    others: Options,
    **settings: Any,
) -> None:
    """Add a scene, or a case file in its place, with options for its keys."""
    parser = scenes.add_parser(
        name,
        help=summary,
        add_help=False,
        usage="%(prog)s --out DIR [option ...] [--set KEY=VALUE ...]",
        # Options and their help are on the same line.
        formatter_class=partial(argparse.HelpFormatter, max_help_position=32, width=88),
        **settings,
    )
    parser.add_argument(
        *("-h", "--help"),
        nargs="?",
        choices=("all",),
        action=_Help,
        help="show this help; `--help all` also lists every key for --set",
    )
    add(parser, OUTPUTS)
    flags: dict[str, str] = {}
    if scene is not None:
        tables = get_type_hints(CaseFile) | {"scene": scene}
        defaults = tables_of(declared({"scene": {"name": name}}))
        groups = {
            name.replace("_", " "): _options_of_scene(scene),
            "mesh, laws, elements and load steps": _common_options(scene.declaration),
        }
        for title, options in groups.items():
            group = parser.add_argument_group(title)
            flags |= _add_keys(group, options, tables, defaults)
    parser.set_defaults(flags=flags)
    add(parser, others)
    parser.add_argument(
        *("-v", "--verbose"),
        action="count",
        default=0,
        help="log every step; if given twice, every iteration",
    )


def _options_of_scene(scene: type[Scene]) -> dict[str, str]:
    """Keys of a scene by option."""
    options = {}
    for key in scene.__struct_fields__:
        without_unit = re.sub(r"_(deg|mm|N|N_per_mm2?)$", "", key)
        flag = _RENAMED.get(key, without_unit).replace("_", "-")
        options[flag] = f"scene.{key}"
    return options


def _common_options(scene: type[AnyScene]) -> dict[str, str]:
    """Keys of the other tables by option."""
    options = dict(_OPTIONS)
    if issubclass(scene, WithTools):
        options |= _OPTIONS_WITH_TOOLS | _OPTIONS_OF_OUTLINES
        options["outline-unit"] = options.pop("unit")  # tools have another one
    elif scene is Specimen:
        options |= _OPTIONS_OF_OUTLINES
    return options


def _add_keys(
    parser: Any,
    options: Mapping[str, str],
    tables: Mapping[str, Any],
    defaults: Mapping[str, Any],
) -> dict[str, str]:
    """Add options of keys; returns the options by key.

    Their help is the meaning of the key and its default.
    """
    for flag, path in options.items():
        table, key = path.split(".")
        hint = _type_of(table, key, tables[table])
        keywords = _keywords(flag, path, hint)
        repeated = "; may be repeated" if keywords.get("action") == "append" else ""
        default = _default(defaults.get(table, {}).get(key))
        keywords["help"] = f"{meaning(hint)}{repeated}{default}"
        parser.add_argument(
            f"--{flag}", dest=path, default=argparse.SUPPRESS, **keywords
        )
    return {path: f"--{flag}" for flag, path in options.items()}


def _keywords(flag: str, path: str, hint: Any) -> dict[str, Any]:
    """Keywords of the option of a key that depend on its type."""
    kind = hint
    while get_origin(kind) in (Annotated, Union, UnionType):
        kind = next(one for one in get_args(kind) if one is not NoneType)
    if path == "mesh.size":
        return {"type": words.size, "metavar": "NXxNY"}
    if kind is bool:
        return {"action": "store_true"}
    if get_origin(kind) is Literal:
        return {"choices": get_args(kind)}
    is_file = FILE in get_args(hint) or path.endswith(".law")
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        several = {"nargs": "+", "action": "extend"}
        number = several if ... in others else {"nargs": len(others) + 1}
        if get_args(first):
            return {**number, "choices": get_args(first)}
        return {**number, "type": first, "metavar": "FILE" if is_file else flag.upper()}
    if get_origin(kind) is dict or issubclass(kind, Struct):
        return {"type": words.pair, "metavar": "NAME=VALUE", "action": "append"}
    metavar = {float: "X", int: "N", str: "NAME"}[kind]
    if path.endswith("_deg"):
        metavar = "DEG"
    elif is_file:
        metavar = "NAME|FILE" if path in _NAME_OR_FILE else "FILE"
    return {"type": kind, "metavar": metavar}


def _default(value: Any) -> str:
    """Default of a key, as the end of its help."""
    if value in (None, (), {}) or isinstance(value, bool | dict):
        return ""
    text = value
    if isinstance(value, tuple):
        numbers_of_elements = all(isinstance(one, int) for one in value)
        text = ("x" if numbers_of_elements else " ").join(map(str, value))
    return f" (default: {text})"


def _type_of(table: str, key: str, hint: Any) -> Any:
    """Type and meaning of a key that has an option."""
    if key == "name":
        return Annotated[Literal[(*named(hint),)], about("element formulation")]
    if table in ("tension", "shear"):
        if key == "law":
            return Annotated[str, about("name of a law, or a .csv or .json file")]
        return Annotated[float, about(f"{table} stiffness in N/mm")]
    return get_type_hints(hint, include_extras=True)[key]


class _Help(argparse.Action):
    """Print the help, and with the word ``all`` every key of a case file."""

    def __call__(
        self, parser: Any, namespace: Any, values: Any, option_string: Any = None
    ) -> None:
        """Print and exit."""
        say(parser.format_help(), end="")
        if values == "all":
            say(key_help(parser.prog.split()[-1]), end="")
        parser.exit()


def tables_of_options(
    tables: Mapping[str, Any], options: argparse.Namespace
) -> dict[str, Any]:
    """Tables of a case with the values of the options.

    Raises
    ------
    ValueError
        If a path leads through a key that is not a table, or a name is given twice.
    """
    case = dict(tables)
    settings = [(path, _joined(v)) for path, v in vars(options).items() if "." in path]
    further = getattr(options, "set", ())
    for flag in "set", "vary":
        given = Counter(path for path, _ in getattr(options, flag, ()))
        for path, times in given.items():
            if times > 1:
                raise ValueError(
                    f"--{flag} {printable(path)} is given twice: omit one of them"
                )
            if path == "scene.name":
                raise ValueError(
                    f"--{flag} scene.name is not supported: name the scene after "
                    f"`{options.command}`"
                )
    for path, value in [*settings, *further]:
        with errors_in(f"--set {path}: "):
            case = with_value(case, path, value)
    if further := getattr(options, "vary", ()):
        case["vary"] = varied(case.get("vary", {})) | varied(dict(further))
    return case


def with_tables(
    options: argparse.Namespace, act: Callable[[Mapping[str, Any], Path], int]
) -> int:
    """Exit code of an act on the tables of a command, and the folder of their files.

    Raises
    ------
    ValueError
        An error of the act, which names what was typed, or the case file.
    """
    path, tables = Path(options.scene), {"scene": {"name": options.scene}}
    if not words.is_case_file(options.scene):
        with typed(options):
            return act(tables_of_options(tables, options), Path())
    tables = read_tables(path)
    with errors_in(f"{printable(path)}: ", CaseFileError):
        return act(tables_of_options(tables, options), path.parent)


def _joined(value: Any) -> Any:
    """Table from pairs of names and values; other values unchanged."""
    if not (isinstance(value, list) and isinstance(value[0], tuple)):
        return value
    names = [name for name, _ in value]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{printable(name)} is given twice: omit one of them")
    return dict(value)
