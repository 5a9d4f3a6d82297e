"""Lines of ``skfem-textile run``: words, values of keys, and their validity.

This is the only module of hostile inputs that lists options and keys of a case.
"""

import math
import re
import tomllib
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

from hypothesis import strategies as st

#: Verdict on a line: it must be rejected, either is right, it must run.
REFUSED, EITHER, TAKEN = range(3)

SCENES = ("strip", "picture_frame", "trellis", "bias_extension", "specimen")
GRADED = "graded"
MESHES = ("aligned", "irregular", "horizontal", "vertical", "delaunay")
SIDES = ("top", "right", "bottom", "left")

_PACKAGES = {"cholmod": "cvxopt", "pardiso": "pypardiso"}
SOLVERS = ("auto", "superlu", *(s for s, p in _PACKAGES.items() if find_spec(p)))

#: Words that few options accept.
ODD = (
    *("nan", "inf", "-inf", "-1", "0", "-0", "0.0", "1e308", "-1e308", "1e400"),
    *("1e-320", "1e20", "-1e-5", "99999999999999999999999", "", " ", " 2 ", "+1"),
    *("1_0", "1,5", "0x10", "1e", "1+2j", "2.0", "٢", "２", "½", "∞", "−1", "é"),
    *("None", "True", "auto", "-", "--", "---", "-x", "a b", "a\nb", "\t", "*"),
    *("\x1b[2J", "\0", "\ud800", "\udcff", "\u202e", "🧵", "%s", "{0}", "%(prog)s"),
    *("x" * 300, "9" * 5000, "..", "~", "$HOME", "@file", "left", "mixed", "45.0"),
)

# -------------------------------------------------------------- kinds of values, limits


def _number(value, low, high, verdict):
    """Rejected unless finite and between limits."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return REFUSED
    return verdict if math.isfinite(value) and low <= value <= high else REFUSED


def _stiffness(value):
    """Products of extreme stiffnesses may overflow."""
    usual = isinstance(value, int | float) and 1e-20 < value < 1e20
    return _number(value, 0, math.inf, TAKEN if usual else EITHER)


def _whole(value, low, high):
    is_whole = isinstance(value, int) or (isinstance(value, float) and value % 1 == 0)
    return _number(value, low, high, EITHER) if is_whole else REFUSED


def _one_of(*names, verdict=TAKEN):
    return lambda value: verdict if value in names else REFUSED


def _cs(value):
    return EITHER if value == "auto" else min(EITHER, _stiffness(value))


def _size(value):
    nx, ny = value
    return TAKEN if nx >= 1 <= ny and nx * ny <= 10**9 else REFUSED


def _side_values(value, numbers, words=()):
    """A number of numbers, or of some words, of sides."""
    for side, entry in value.items():
        entry = entry if isinstance(entry, list) else [entry]
        finite = (x in words or _number(x, -1e308, 1e308, EITHER) for x in entry)
        if side not in SIDES or len(entry) != numbers or not all(finite):
            return REFUSED
    return EITHER


def toml(word):
    """The value of ``--set``: TOML, an array of TOML, or else the word itself."""
    for text in (word, f"[{word}]"):
        try:
            return tomllib.loads(f"x = {text}")["x"]
        except (ValueError, RecursionError):
            continue
    return word


def _pair(word):
    name, _, value = word.partition("=")
    if not (name and value):
        raise ValueError(word)
    parts = [toml(part) for part in value.split(",")]
    return {name: parts if len(parts) > 1 else parts[0]}


def _size_of(word):
    nx, ny = (int(n) for n in word.split("x"))
    return [nx, ny]


class Key(NamedTuple):
    """A key of a case, and the way in which a line gives its value.

    ``flag`` is its option, empty where it has ``--set`` alone; ``limits`` gives the
    verdict of a value; ``odd`` are words, separated by bars, that are tried beside the
    words of `ODD`; ``read`` gives the value of a word of the option.
    """

    path: str
    flag: str
    limits: Callable[[Any], int]
    odd: str = ""
    read: Callable[[str], Any] = float


_angle = partial(_number, low=-36e3, high=36e3, verdict=EITHER)
_length = partial(_number, low=1e-300, high=math.inf, verdict=EITHER)
_density = partial(_number, low=1e-300, high=math.inf, verdict=EITHER)
_share = partial(_number, low=0, high=1 - 1e-16, verdict=EITHER)
_right_angle = partial(_number, low=1e-300, high=90, verdict=TAKEN)
_steps = partial(_whole, low=1, high=10**6)
_one, _two = (partial(_side_values, numbers=n) for n in (1, 2))
_two_or_free = partial(_side_values, numbers=2, words=("free",))

_ANGLES = "90|89.9999|180|360|-45|1e-9|45.0000000001|720|1e9"
_SIZES = (
    "0x5|-1x5|6x9x2|10|x|3x|3X4|3×4|２x２|1_0x1|2 x 3|1e1x2|nanxnan|2.0x3|1x1|0x0|"
    "-2x-2|100000x100000|1000000x1000000|99999999999999999999999x1"
)
_FILES = (
    "curly|Irregular|missing.msh|folder|junk.msh|junk.vtu|empty.vtu|junk.inp|."
    "|quads good.vtu|triangles good.vtu"
)
_FORCES = (
    "top=1,2|right=-0.5,0.1|lid=1,2|top=nan,0|top=1e308,0|=1,2|top|top=1|top=1,2,3|"
    "left=inf,0|right=0,0|bottom=1_0,-0"
)
_MOVES = (
    "top=0,5|bottom=0,0|left=free,free|right=free,0|lid=0,0|top|top=1|top=1,2,3|"
    "top=nan,0|top=fre,1|=0,1"
)
_ROLLERS = (
    "left=30|top=nan|lid=3|left|=|left=|=3|right=inf|top=-20|bottom=1e308|right=90|"
    "left=3=4"
)
_CHECKS = "['work']|['magic']|['folding', 'strain']|work"
_CURVES = "curve.csv|missing.csv|junk.inp|folder|curve.csv\0|"
_STEPS = "0|-1|1000001|10000000000000000000000|1.5|2e0|1|２"

_MESH_FILES = ("quads good.vtu", "triangles good.vtu")
_known_mesh = _one_of(GRADED, *MESHES, *_MESH_FILES, verdict=EITHER)
_elements = _one_of("macro", "full", "quadratic", "one-point", verdict=EITHER)
_kind = _one_of("energy", "rate", "continuity", "isotropic", verdict=EITHER)

# Keys of laws that are not tested here.
_OF_OTHER_LAWS = (
    *("tension.toe", "tension.initial_stiffness_N_per_mm", "tension.warp_crimp"),
    *("tension.bending_N_per_mm", "tension.extrapolation", "tension.continuation"),
    *("shear.locking_angle_deg", "shear.coefficients_N_per_mm", "shear.variable"),
    *("shear.extrapolation", "shear.continuation"),
)
_none = _one_of()

_KEYS = (
    Key("scene.rotate_deg", "rotate", _angle, _ANGLES),
    Key("mesh.source", "mesh", _known_mesh, _FILES, str),
    Key("mesh.size", "size", _size, _SIZES, _size_of),
    Key("mesh.density", "density", _density, "0|-1|1e-9|1e9"),
    Key("mesh.jitter", "", _share),
    Key("mesh.seed", "", partial(_whole, low=0, high=math.inf)),
    Key("formulation.name", "formulation", _elements, "macro|full|Full|quadratic", str),
    Key("formulation.cs_N_per_mm", "", _cs),
    Key("formulation.stabilisation", "", _kind, "rate|isotropic|magic"),
    Key("formulation.deviation", "", lambda value: EITHER),
    Key("tension.stiffness_N_per_mm", "fibre-stiffness", _stiffness),
    Key("shear.stiffness_N_per_mm", "shear-stiffness", _stiffness),
    Key("shear.law", "shear-law", _one_of("sin2", "linear"), "sin2|sin|linear", str),
    Key("tension.law", "tension-law", _one_of("linear"), "", str),
    Key("tension.compression", "", _one_of("law", "none"), "none|law|non"),
    Key("tension.pretension_N_per_mm", "", lambda x: min(EITHER, _stiffness(x))),
    *(Key(f"bending.{of}_N_mm", "", _stiffness) for of in ("warp", "weft", "twist")),
    Key("shear.wrinkling_angle_deg", "", _right_angle),
    Key("loads.force_N", "force", _two, _FORCES, _pair),
    Key("stepping.steps", "steps", _steps, _STEPS, int),
    Key("stepping.method", "", _one_of("newton", "plain"), "newton|plain|magic"),
    Key("stepping.warn_only", "", lambda value: EITHER, _CHECKS),
    Key("stepping.solver", "solver", _one_of(*SOLVERS), "superlu|magic|cholmod", str),
    Key("mesh.directions", "directions", _none, _CURVES, str),
    Key("mesh.outline", "outline", _none, _CURVES, str),
    Key("fabric.file", "fabric", _none, _CURVES, str),
    *(Key(path, "", _none) for path in _OF_OTHER_LAWS),
    Key("output.test_curve", "test-curve", _one_of("curve.csv"), _CURVES, str),
)

_FIBRES = (
    Key("scene.warp_deg", "fibres", _angle, _ANGLES),
    Key("scene.weft_deg", "weft", _angle, _ANGLES),
)
_SHEAR_ANGLE = Key("scene.shear_angle_deg", "shear-angle", _angle, _ANGLES)
_side = _one_of(*SIDES, verdict=EITHER)
_part = _one_of("half", "whole", verdict=EITHER)

_OF_SCENES: dict[str, tuple[Key, ...]] = {
    "strip": (),
    "picture_frame": (_SHEAR_ANGLE,),
    "trellis": (
        *(*_FIBRES, _SHEAR_ANGLE),
        Key("scene.bend_deg", "bend", _angle, _ANGLES),
        Key("scene.free", "free", lambda x: _side(*x), "top|lid|left", lambda x: [x]),
        Key("scene.roller_deg", "roller", _one, _ROLLERS, _pair),
    ),
    "bias_extension": (
        *(*_FIBRES, _SHEAR_ANGLE),
        Key("scene.part", "part", _part, "half|third|whole", str),
    ),
    "specimen": (
        *_FIBRES,
        Key("scene.width_mm", "width", _length),
        Key("scene.height_mm", "height", _length),
        Key("scene.move_mm", "move", _two_or_free, _MOVES, _pair),
        Key("scene.driven", "driven", _side, "top|left|lid", str),
    ),
}


def keys(scene: str) -> tuple[Key, ...]:
    """The keys of a case of a scene."""
    return _KEYS + _OF_SCENES[scene]


# Folders of results and of checkpoints.
_BAD_FOLDERS = ("file", "file/x", "", "/proc/nothing", "a\0b", "a" * 300, "empty.vtu")
_BAD_CHECKPOINTS = ("junk", "file", "a\0b")
_FOLDERS = ("a/b/c", "there", ".", "x\ny", "é ü", "~", "\udcff")

# ------------------------------------------------------------------------------- lines


class Line(NamedTuple):
    """A line of the command line.

    ``values`` are by the paths of their keys, None for a line from which a word was
    deleted; ``checkpoint`` is a folder, empty for the folder of the results.
    """

    words: list[str]
    verdict: int
    values: dict[str, Any] | None = None
    scene: str = ""
    out: str = "out"
    checkpoint: str | None = None
    is_verbose: bool = False
    is_drawn: bool = False


class Part(NamedTuple):
    """Words that belong together, the key that they set, and its value."""

    words: list[str]
    verdict: int = TAKEN
    key: Key | None = None
    value: Any = None


def key_part(key: Key, word: str, attached: bool = False, name: str = "") -> Part:
    """A key set by its option, or by ``--set`` if it has none."""
    if not key.flag:
        return Part(["--set", f"{key.path}={word}"], TAKEN, key, toml(word))
    name = f"--{name or key.flag}"
    words = [f"{name}={word}"] if attached else [name, word]
    # A word that looks like an option may be taken for one.
    is_plain = word[:1] != "-" or re.fullmatch(r"-\d*\.?\d+|-", word)
    try:
        return Part(words, TAKEN if is_plain else EITHER, key, key.read(word))
    except ValueError:
        return Part(words, REFUSED)


@st.composite
def lines(draw, scene: str) -> Line:
    """A line, mostly valid, with a few parts that may be invalid."""
    of = {key.flag or key.path.split(".")[1]: key for key in keys(scene)}
    sound = [key_part(of[name], word) for name, word in draw(sound_words(scene))]
    is_drawn = draw(st.integers(0, 199)) == 100
    free = [] if is_drawn else [Part(["--no-render"])]
    checkpoint = draw(
        st.sampled_from((None, None, None, "", "kept", *_BAD_CHECKPOINTS))
    )
    if checkpoint is not None:
        word = draw(st.sampled_from(("--checkpoint", "--resume")))
        verdict = REFUSED if checkpoint in _BAD_CHECKPOINTS else TAKEN
        free.append(Part([word] + [checkpoint] * bool(checkpoint), verdict))
    is_verbose = draw(st.integers(0, 9)) == 9
    free += [Part([draw(st.sampled_from(("-v", "-vv", "--verbose")))])] * is_verbose
    out = "out"
    if draw(st.integers(0, 6)) == 6:
        out = draw(st.sampled_from((*_FOLDERS, *_BAD_FOLDERS, "blocked")))
    free.append(Part(["--out", out], TAKEN if out in ("out", *_FOLDERS) else REFUSED))
    number = draw(st.sampled_from((0, 0, 1, 1, 1, 2, 3)))
    odd = [draw(odd_part(scene)) for _ in range(number)]
    parts = [*draw(st.permutations([*sound, *free])), *odd]
    values, odd_values = _values_of(parts), _values_of(odd)
    verdicts = [part.verdict for part in parts]
    verdicts += [
        key.limits(values[key.path]) for key in keys(scene) if key.path in odd_values
    ]
    verdict = min(*verdicts, _combined_verdict(scene, values))
    words = ["run", scene, *(word for part in parts for word in part.words)]
    if draw(st.integers(0, 24)) == 24:
        del words[draw(st.integers(0, len(words) - 1))]
        return Line(words, EITHER, None, scene, out, checkpoint, True, is_drawn)
    if not is_drawn:
        values["output.pictures"] = False
    return Line(words, verdict, values, scene, out, checkpoint, is_verbose, is_drawn)


def _values_of(parts):
    """Values by path: later ones override, ``--set`` last; pairs add up."""
    values: dict[str, Any] = {}
    for part in sorted(parts, key=lambda part: part.words[0] == "--set"):
        if part.key:
            path, value = part.key.path, part.value
            if isinstance(value, dict) and isinstance(values.get(path), dict):
                value = values[path] | value
            values[path] = value
    return values


#: Keys of meshes that are not graded.
OF_GRID = frozenset(("mesh.size", "mesh.jitter", "mesh.seed"))


def kind_of_mesh(scene, values):
    """The source of the mesh of a line."""
    is_graded = scene not in ("strip", "trellis") and not OF_GRID & values.keys()
    return values.get("mesh.source", GRADED if is_graded else "irregular")


def formulation(scene, values):
    """The name of the formulation of a line."""
    is_graded = kind_of_mesh(scene, values) == GRADED
    return values.get("formulation.name", "quadratic" if is_graded else "macro")


def _combined_verdict(scene, values):
    """The verdict of values that may contradict one another."""
    get, name = values.get, formulation(scene, values)
    made, source = OF_GRID & values.keys(), kind_of_mesh(scene, values)
    shear = 0.0 if scene == "strip" else 0.5
    stiffness = (
        get("tension.stiffness_N_per_mm", 1.0),
        get("shear.stiffness_N_per_mm", shear),
    )
    contradictions = (
        made and source not in MESHES,
        "mesh.density" in values and source != GRADED,
        name != "one-point" and "formulation.stabilisation" in values,
        name in ("full", "quadratic") and "formulation.cs_N_per_mm" in values,
        name in ("full", "one-point") and "formulation.deviation" in values,
        stiffness == (0, 0),
        {*get("scene.free", ())} & {*get("scene.roller_deg", ())},
    )
    if any(contradictions):
        return REFUSED
    usual = {"warp": 0.0, "weft": 90.0, "shear_angle": 45.0}
    if scene == "bias_extension":
        usual |= {"warp": 45.0, "shear_angle": 40.0}
    angles = [get(f"scene.{key}_deg", angle) for key, angle in usual.items()]
    if not all(isinstance(x, int | float) and abs(x) < 1e4 for x in angles):
        return EITHER
    warp, weft, shear_angle = angles
    is_wrong = {
        "picture_frame": abs(shear_angle) >= 90,
        "trellis": abs(math.sin(math.radians(weft - warp))) < 1e-6,
        "bias_extension": not 0 < warp % 180 < 90
        or not 0 < shear_angle < 180 - 2 * (warp % 180),
    }
    return REFUSED if is_wrong.get(scene) else TAKEN


@st.composite
def sound_words(draw, scene):
    """Names of keys and words that go together."""
    one, some = (lambda *words: draw(st.sampled_from(words))), st.integers
    parts = [
        ("fibre-stiffness", one("1e4", "100", "1e3")),
        ("shear-stiffness", one("0", "0.5", "2", "10")),
        ("warp_N_mm", one("0", "0.5", "10")),
        ("shear-law", one("linear", "sin2")),
        ("rotate", one("30", "-77.5", "0", "180")),
        ("method", one("newton", "plain")),
        ("warn_only", one("[]", "['work']", "['stability', 'corners']")),
        ("solver", one(*SOLVERS)),
        ("force", one("right=0.5,0.2", "top=-0.3,0.1")),
    ]
    chosen = draw(st.lists(st.sampled_from(parts), max_size=4, unique=True))
    chosen.append(("steps", one("1", "2")))
    if scene != "bias_extension" and draw(some(0, 14)) == 14:
        chosen.append(("mesh", one(*_MESH_FILES)))
    elif draw(some(0, 5)) == 5:
        chosen += ("mesh", GRADED), ("density", one("0.25", "0.5"))
    else:
        chosen.append(("size", f"{draw(some(1, 4))}x{draw(some(1, 6))}"))
        made = ("mesh", one(*MESHES)), ("seed", str(draw(some(0, 10**6))))
        made += (("jitter", one("0", "0.1", "0.2")),)
        chosen += draw(st.lists(st.sampled_from(made), unique=True))
    # Jumps between few elements leave zero-energy modes: other scenes take long.
    kinds = ("isotropic", "rate") + ("continuity",) * (scene == "picture_frame")
    one_point = ("formulation", "one-point")
    chosen += one(
        *((), (), [one_point], [("cs_N_per_mm", "4")], [("formulation", "full")]),
        *([("formulation", "quadratic")], [one_point, ("cs_N_per_mm", "auto")]),
        [("formulation", "quadratic"), ("deviation", "20")],
        [("formulation", "macro"), ("cs_N_per_mm", "2.5")],
        [one_point, ("stabilisation", one(*kinds)), ("cs_N_per_mm", "3")],
    )
    angle, held = str(draw(some(5, 50))), ("move", "bottom=0,0")
    of_scene = {
        "strip": [[]],
        "picture_frame": [[], [("shear-angle", angle)]],
        "bias_extension": [
            *([], [("fibres", str(draw(some(30, 60)))), ("shear-angle", "20")]),
            *([("part", "half")], [("shear-angle", "20")]),
        ],
        "specimen": [
            *([], [("driven", "top")], [("move", "top=0,5"), held]),
            [("move", "top=free,-3"), held, ("test-curve", "curve.csv")],
            [("fibres", angle), ("weft", "100"), ("driven", "bottom")],
        ],
        "trellis": [
            *([], [("fibres", str(draw(some(-30, 30)))), ("shear-angle", "20")]),
            [("weft", str(draw(some(70, 110)))), ("shear-angle", "15")],
            [("bend", str(draw(some(-20, 30)))), ("free", one("top", "left"))],
            [("roller", f"right={draw(some(-80, 80))}"), ("free", "bottom")],
        ],
    }
    return chosen + one(*of_scene[scene])


@st.composite
def odd_part(draw, scene):
    """An option with an odd word, without one, cut short, of another scene, or none."""
    scene_keys = keys(scene)
    flags = [key.flag for key in scene_keys if key.flag]
    known = [*flags, "help", "out", "no-render", "set", "checkpoint", "resume"]
    known += ["verbose", "tolerance"]
    key, choice = draw(st.sampled_from(scene_keys)), draw(st.integers(0, 99))
    word = draw(
        st.sampled_from(key.odd.split("|") if key.odd and choice % 10 < 7 else ODD)
    )
    if choice < 8:
        others = {k.flag for keys in _OF_SCENES.values() for k in keys} - {*flags}
        strange = [
            name for name in others if not any(k.startswith(name) for k in known)
        ]
        if strange:
            return Part([f"--{draw(st.sampled_from(sorted(strange)))}", "1"], REFUSED)
    if choice < 16:
        odd = ("steps=", "nothing", "s", "=", "paper x", "set x", "set x.y")
        return Part([f"--{draw(st.sampled_from(odd))}".replace(" ", "=")], REFUSED)
    if choice == 16:
        return Part(["--checkpoint", "one", "--resume", "two"], REFUSED)
    if choice < 20 and key.flag:
        return Part([f"--{key.flag}"], REFUSED)  # the last word, or before an option
    if choice < 30 and key.flag:
        name = key.flag[: draw(st.integers(1, len(key.flag)))]
        matches = [k for k in known if k.startswith(name)]
        if name not in known and matches != [key.flag]:
            return Part([f"--{name}", word], REFUSED)
        return (
            key_part(key, word, name=name) if name not in known else key_part(key, word)
        )
    return key_part(key, word, draw(st.integers(0, 4)) == 4)


_BAD = ("0", "-1", "nan", "1.5", "", "x", "²", "9" * 5000, "\0")


@st.composite
def other_lines(draw) -> Line:
    """A line that runs nothing, or that must be rejected."""
    bad, scene = draw(st.sampled_from(_BAD)), draw(st.sampled_from(SCENES))
    answered = ["list"], ["--version"], ["run", scene, "--help"], ["run", scene, "-h"]
    out = ["--out", "out"]
    refused = (
        *(["list", bad], [], [bad], ["run"], ["study"], ["run", bad, *out]),
        *(["Run", scene, *out], ["run", *out, "--steps", "1"], ["run", scene]),
        *(["study", bad, *out], ["study", "stability", *out, "--resume", bad]),
        *(["run", "two_element", *out], ["run", "strip", *out, "--paper"]),
        *(["run", scene, bad, *out], ["run", scene, *out, "--help", "nothing"]),
    )
    words = draw(st.sampled_from((*answered, *refused)))
    return Line(words, EITHER if words in answered else REFUSED)


def any_line() -> dict[str, st.SearchStrategy]:
    """Lines of each scene, and others; one in thirty."""
    others = {"other": other_lines()}
    return {f"{n} {s}": lines(s) for n in range(6) for s in SCENES} | others


# -------------------------------------------------------------------------- case files


def case_text(one: Callable[..., Any]) -> str:
    """The text of a sound case file, which takes a moment to run.

    Parameters
    ----------
    one
        Chooses one of its arguments.
    """
    scene = one(*SCENES)
    of_scene = {
        "strip": [],
        "bias_extension": ["shear_angle_deg = 15", 'part = "half"'],
        "picture_frame": ["shear_angle_deg = 15.5"],
        "trellis": [
            "bend_deg = 10",
            'free = ["left"]',
            "[scene.roller_deg]",
            "right = 30",
        ],
        "specimen": [
            *('driven = "top"', "height_mm = 105.0", "[scene.move_mm]"),
            *("bottom = [0, 0]", one("top = [0, 4]", 'top = ["free", 4]')),
        ],
    }
    tension = ["[tension]", "stiffness_N_per_mm = 1000.0"]
    toe = ['law = "crimp-toe"', "toe = 0.004", "initial_stiffness_N_per_mm = 10"]
    tension += one([], [*toe, 'compression = "none"'])
    tension += one([], ["pretension_N_per_mm = 0.1"])
    weft = ["[tension.weft]", "stiffness_N_per_mm = 500.0"]
    compressed = ["[tension.in_compression]", "stiffness_N_per_mm = 20.0"]
    other = weft if 'compression = "none"' in tension else compressed
    lines = [
        *("[scene]", f'name = "{scene}"', f"rotate_deg = {one(0, 30)}"),
        *of_scene[scene],
        *("[mesh]", 'source = "aligned"', "size = [2, 3]", "jitter = 0.1"),
        *(*tension, *one([], weft, other), "[shear]"),
        *one(
            ['law = "shear.csv"', 'continuation = "odd"'],
            ['law = "sin2"', "stiffness_N_per_mm = 0.5"],
            ['law = "polynomial"', "coefficients_N_per_mm = [0.5, 0, 1.5]"],
        ),
        *one([], ["[formulation]", 'name = "one-point"', "cs_N_per_mm = 4.0"]),
        *one([], ["[loads.force_N]", "right = [0.1, 0.0]"]),
        *("[stepping]", "steps = 1", 'method = "newton"', 'solver = "superlu"'),
        *("[output]", "pictures = false", *one([], ['test_curve = "test.csv"'])),
    ]
    return "\n".join([*lines, ""])
