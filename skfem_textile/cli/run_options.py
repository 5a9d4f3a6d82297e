"""Options of the command ``run``, generated from the declaration of a case."""

import argparse
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from ..cases.read import CaseFile, declared
from ..cases.scenes import SCENES, Scene
from ..cases.schema import FILE, summary_of
from ..cases.write import key_help, meaning, tables_of
from ..declarations import words
from ..declarations.scenes import Specimen, WithTools
from ..declarations.words import Options, option
from ..mesh.user_input import printable
from .options import OUTPUTS, add
from .output import say

# Options for common keys, in addition to the keys of the scene.
_OPTIONS = {
    "mesh": ("mesh.source", "mesh file, or kind of generated mesh"),
    "density": ("mesh.density", "factor of the number of lines of a graded mesh"),
    "size": (
        "mesh.size",
        "number of elements along x and y, such as 8x16, of a mesh that is not graded",
    ),
    "mesh-as-is": ("mesh.as_is", "leave a mesh that is not graded as it is"),
    "directions": ("mesh.directions", "file with the fibre directions of the elements"),
    "fabric": ("fabric.file", "file that contains all laws"),
    "tension-law": ("tension.law", "name of a law, or a .csv or .json file"),
    "fibre-stiffness": ("tension.stiffness_N_per_mm", "tension stiffness in N/mm"),
    "shear-law": ("shear.law", "name of a law, or a .csv or .json file"),
    "shear-stiffness": ("shear.stiffness_N_per_mm", "shear stiffness in N/mm"),
    "formulation": ("formulation.name", "element formulation"),
    "force": ("loads.force_N", "force in N on a boundary; may be repeated"),
    "steps": ("stepping.steps", "number of load steps"),
    "tolerance": (
        "stepping.tolerance",
        "make the mesh finer until the error interval of the load, relative to it, is "
        "below this value",
    ),
    "solver": ("stepping.solver", "linear solver"),
    "test-curve": (
        "output.test_curve",
        "CSV file with a test curve, drawn with the curve of the run",
    ),
}
_OPTIONS_OF_OUTLINES = {
    "outline": (
        "mesh.outline",
        "outline of the ply: a drawing (.dxf, .svg), or a table of x and y (.csv)",
    ),
    "unit": (
        "mesh.unit",
        "unit of length of the drawing (default: the file's, else mm)",
    ),
    "layer": (
        "mesh.layer",
        "layers of the drawing that are read, or id of elements (default: all)",
    ),
}
_OPTIONS_WITH_TOOLS = {
    "part-mesh": (
        "output.part_mesh",
        "mesh of the part, to whose elements fibre directions are mapped",
    ),
    "deck": (
        "output.deck",
        "deck of the part, of which a copy with the layers of the ply is written",
    ),
    "thickness": ("output.thickness_mm", "thickness of the flat ply, for a deck"),
    "material": (
        "output.material",
        "material of the layers in the deck (default: as in its sections)",
    ),
    "calculix": ("output.calculix", "write an .inp deck for CalculiX too"),
    "part-reach": (
        "output.part_reach_mm",
        "largest distance of the part from the ply on it",
    ),
    "trim": (
        "output.trim",
        "tables or DXF files of the curves along which the flat pattern is trimmed: "
        "the outline, then holes",
    ),
    "pattern": ("output.pattern", "kinds of files of the flat pattern (default: all)"),
}

# Options of every scene and case file, besides their keys.
_EVERY: Options = {
    "--set": option(
        "set any key of a case file, such as stepping.method=plain",
        words.setting,
        "KEY=VALUE",
        action="extend",
        nargs="+",
        default=[],
    ),
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

_EXIT_CODES = (
    "exit code: 0 if every step converged; 1 if the run stopped early (the last "
    "converged state is written) or the results cannot be written; 2 for invalid input "
    "(nothing is written); 130 if interrupted by Ctrl-C or SIGTERM (the last converged "
    "state is written)"
)


def add_run(parser: argparse.ArgumentParser, named: Sequence[str] | None) -> None:
    """Add the scenes; values of case keys are stored by the path of the key.

    Parameters
    ----------
    parser
        Parser of the command.
    named
        Scene or case file; only this scene gets its options. All scenes if None.
    """
    scenes = parser.add_subparsers(dest="scene", required=True)
    for name, scene in SCENES.items():
        is_named = named is None or name in named[:1]
        _add_scene(scenes, name, summary_of(scene), scene if is_named else None)
    files = [word for word in (named or ())[:1] if words.is_case_file(word)]
    _add_scene(scenes, words.CASE_FILE, "a case file", None, aliases=files)


def add_exports(parser: argparse.ArgumentParser, others: Options) -> None:
    """Add the options of a command, and missing ones of exports."""
    add(parser, others)
    parser.set_defaults(
        flags=dict(
            _add_key(parser, flag, path, _type_of(path), about)
            for flag, (path, about) in _OPTIONS_WITH_TOOLS.items()
            if f"--{flag}" not in others
        )
    )


def as_typed(message: str, options: argparse.Namespace) -> str:
    """Message with the options that were typed, or exist, in place of case keys."""
    by_key = {path for path, _ in getattr(options, "set", ())}
    flags = {k: f for k, f in options.flags.items() if k not in by_key}
    return _KEY.sub(lambda found: flags.get(found[0], found[0]), message)


def _add_scene(
    scenes: Any, name: str, about: str, scene: type[Scene] | None, **settings: Any
) -> None:
    """Add a scene, or a case file in its place, with options for its keys."""
    parser = scenes.add_parser(
        name,
        help=about,
        epilog=_EXIT_CODES,
        add_help=False,
        usage="%(prog)s --out DIR [option ...] [--set KEY=VALUE ...]",
        formatter_class=_Formatter,
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
        defaults = tables_of(declared({"scene": {"name": name}}))
        of_scene = parser.add_argument_group(name.replace("_", " "))
        for key, hint in get_type_hints(scene, include_extras=True).items():
            if key in scene.__struct_fields__:
                flag = _RENAMED.get(key, _without_unit(key)).replace("_", "-")
                help_text = meaning(hint) + _default(defaults["scene"].get(key))
                key, text = _add_key(of_scene, flag, f"scene.{key}", hint, help_text)
                flags[key] = text
        of = scene.declaration
        with_tools = issubclass(of, WithTools)
        options = _OPTIONS | (_OPTIONS_WITH_TOOLS if with_tools else {})
        options |= _OPTIONS_OF_OUTLINES if with_tools or of is Specimen else {}
        if with_tools:  # the unit of tools is another one
            options["outline-unit"] = options.pop("unit")
        group = parser.add_argument_group("mesh, laws, elements and load steps")
        for flag, (path, about) in options.items():
            table, key = path.split(".")
            help_text = about + _default(defaults[table].get(key))
            key, text = _add_key(group, flag, path, _type_of(path), help_text)
            flags[key] = text
    parser.set_defaults(flags=flags)
    add(parser, _EVERY)
    parser.add_argument(
        *("-v", "--verbose"),
        action="count",
        default=0,
        help="log every step; if given twice, every iteration",
    )


def _add_key(
    parser: Any, flag: str, path: str, hint: Any, about: str
) -> tuple[str, str]:
    """Add the option of a key, with values of its type; returns key and option."""
    kwargs: dict[str, Any] = {"dest": path, "default": argparse.SUPPRESS, "help": about}
    kind = hint
    while get_origin(kind) is Annotated or NoneType in get_args(kind):
        kind = next(one for one in get_args(kind) if one is not NoneType)
    if path == "mesh.size":
        kwargs |= {"type": words.size, "metavar": "NXxNY"}
    elif kind is bool:
        kwargs["action"] = "store_true"
    elif get_origin(kind) is Literal:
        kwargs["choices"] = get_args(kind)
    elif get_origin(kind) is tuple:
        first, *others = get_args(kind)
        several = {"nargs": "+", "action": "extend"}
        kwargs |= several if ... in others else {"nargs": len(others) + 1}
        if get_args(first):
            kwargs["choices"] = get_args(first)
        else:
            metavar = "FILE" if FILE in get_args(hint) else flag.upper()
            kwargs |= {"type": first, "metavar": metavar}
    elif get_origin(kind) is dict:
        kwargs |= {"type": words.pair, "metavar": "NAME=VALUE"}
        kwargs |= {"action": "append"}
    elif isinstance(kind, type):
        metavar = {float: "X", int: "N", str: "NAME"}[kind]
        if FILE in get_args(hint) or path.endswith(".law"):
            metavar = "NAME|FILE" if path in _NAME_OR_FILE else "FILE"
        kwargs |= {"type": kind, "metavar": "DEG" if path.endswith("_deg") else metavar}
    parser.add_argument(f"--{flag}", **kwargs)
    return path, f"--{flag}"


def _default(value: Any) -> str:
    """Default of a key, as the end of its help."""
    if value in (None, (), {}) or isinstance(value, bool | dict):
        return ""
    text = value
    if isinstance(value, tuple):
        numbers_of_elements = all(isinstance(one, int) for one in value)
        text = ("x" if numbers_of_elements else " ").join(map(str, value))
    return f" (default: {text})"


def _type_of(path: str) -> Any:
    """Type of a key that has an option."""
    table, key = path.split(".")
    hint = get_type_hints(CaseFile, include_extras=True)[table]
    if key == "name":
        return Literal[tuple(one.__struct_config__.tag for one in get_args(hint))]
    if table in ("tension", "shear"):
        return float if key.endswith("N_per_mm") else str
    return get_type_hints(hint, include_extras=True)[key]


def _without_unit(key: str) -> str:
    return re.sub(r"_(deg|mm|N|N_per_mm2?)$", "", key)


class _Formatter(argparse.HelpFormatter):
    """Help formatter that prints options and help on the same line."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=32, width=88)


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
    case = {name: _copied(own) for name, own in tables.items()}
    settings = [(path, _joined(v)) for path, v in vars(options).items() if "." in path]
    further = getattr(options, "set", ())
    for path, times in Counter(path for path, _ in further).items():
        if times > 1:
            raise ValueError(
                f"--set {printable(path)} is given twice: omit one of them"
            )
        if path == "scene.name":
            raise ValueError(
                "--set scene.name is not supported: name the scene after `run`"
            )
    for path, value in [*settings, *further]:
        *around, key = path.split(".")
        table: Any = case
        for name in around:
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                raise ValueError(f"--set {path}: {name} is a value, not a table")
        table[key] = value
    return case


def _joined(value: Any) -> Any:
    """Table from pairs of names and values; other values unchanged."""
    if not (isinstance(value, list) and isinstance(value[0], tuple)):
        return value
    names = [name for name, _ in value]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{printable(name)} is given twice: omit one of them")
    return dict(value)


def _copied(value: Any) -> Any:
    """Copy of nested tables."""
    if isinstance(value, dict):
        return {key: _copied(one) for key, one in value.items()}
    return value
