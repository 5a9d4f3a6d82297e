"""Lines of ``skfem-textile run``: a sound one, to which one change is applied.

This is the only module of hostile inputs that lists options and keys of a case.
"""

import tomllib
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from types import MappingProxyType
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

# -------------------------------------------------------------------------------- keys


class Key(NamedTuple):
    """A key of a case, and its option, empty where it has ``--set`` alone.

    ``bad`` are words, separated by bars, that it must refuse.
    """

    path: str
    flag: str
    bad: str


_MESH_FILES = ("quads good.vtu", "triangles good.vtu")
_NO_NUMBER = "nan|inf|-inf|1e400|x||1,5|1+2j|None|a b"
_NO_STIFFNESS = f"{_NO_NUMBER}|-1|-1e-5"
_NO_LENGTH = f"{_NO_STIFFNESS}|0"
_NO_ANGLE = f"{_NO_NUMBER}|1e9"
_NO_NAME = "magic|Full|1|"
_NO_FILE = "curly|missing.msh|folder|junk.msh|junk.vtu|empty.vtu|junk.inp|."
_NO_SIZE = "0x5|-1x5|6x9x2|10|x|3x|3X4|3×4|1e1x2|nanxnan|2.0x3|0x0|1000000x1000000"
_NO_FORCE = "lid=1,2|top=nan,0|=1,2|top|top=1|top=1,2,3|left=inf,0"
_NO_MOVE = "lid=0,0|top|top=1|top=1,2,3|top=nan,0|top=fre,1|=0,1"
_NO_ROLLER = "top=nan|lid=3|left|=|left=|=3|right=inf|left=3=4"

_KEYS = (
    Key("scene.rotate_deg", "rotate", _NO_ANGLE),
    Key("mesh.source", "mesh", _NO_FILE),
    Key("mesh.size", "size", _NO_SIZE),
    Key("mesh.density", "density", _NO_LENGTH),
    Key("mesh.jitter", "", f"{_NO_STIFFNESS}|1|2"),
    Key("mesh.seed", "", f"{_NO_STIFFNESS}|1.5"),
    Key("mesh.as_is", "", "yes|1"),
    Key("formulation.name", "formulation", _NO_NAME),
    Key("formulation.cs_N_per_mm", "", _NO_STIFFNESS),
    Key("formulation.stabilisation", "", _NO_NAME),
    Key("formulation.deviation", "", "x|-1"),
    Key("tension.stiffness_N_per_mm", "fibre-stiffness", _NO_STIFFNESS),
    Key("shear.stiffness_N_per_mm", "shear-stiffness", _NO_STIFFNESS),
    Key("shear.law", "shear-law", _NO_NAME),
    Key("tension.law", "tension-law", _NO_NAME),
    Key("tension.compression", "", _NO_NAME),
    Key("tension.pretension_N_per_mm", "", _NO_STIFFNESS),
    *(Key(f"bending.{of}_N_mm", "", _NO_STIFFNESS) for of in ("warp", "weft", "twist")),
    Key("shear.wrinkling_angle_deg", "", f"{_NO_LENGTH}|91"),
    Key("loads.force_N", "force", _NO_FORCE),
    Key("stepping.steps", "steps", "0|-1|1000001|1.5|2e0|x|"),
    Key("stepping.method", "", _NO_NAME),
    Key("stepping.warn_only", "", "['magic']|work|1"),
    Key("stepping.solver", "solver", _NO_NAME),
    Key("mesh.directions", "directions", "curve.csv|missing.csv|junk.inp|folder"),
    Key("mesh.outline", "outline", "curve.csv|missing.csv|junk.inp|folder"),
    Key("fabric.file", "fabric", "curve.csv|missing.csv|junk.inp|folder"),
    Key("output.test_curve", "test-curve", "missing.csv|junk.inp|folder|curve.csv\0"),
)

_FIBRES = (
    Key("scene.warp_deg", "fibres", _NO_ANGLE),
    Key("scene.weft_deg", "weft", _NO_ANGLE),
)
_SHEAR_ANGLE = Key("scene.shear_angle_deg", "shear-angle", _NO_ANGLE)

_OF_SCENES: dict[str, tuple[Key, ...]] = {
    "strip": (),
    "picture_frame": (_SHEAR_ANGLE,),
    "trellis": (
        *(*_FIBRES, _SHEAR_ANGLE),
        Key("scene.bend_deg", "bend", _NO_ANGLE),
        Key("scene.free", "free", "lid|1"),
        Key("scene.roller_deg", "roller", _NO_ROLLER),
    ),
    "bias_extension": (*_FIBRES, _SHEAR_ANGLE, Key("scene.part", "part", "third|")),
    "specimen": (
        *_FIBRES,
        Key("scene.width_mm", "width", _NO_LENGTH),
        Key("scene.height_mm", "height", _NO_LENGTH),
        Key("scene.move_mm", "move", _NO_MOVE),
        Key("scene.driven", "driven", "lid|"),
    ),
}


def keys(scene: str) -> dict[str, Key]:
    """The keys of a case of a scene, by their option or the end of their path."""
    keys = _KEYS + _OF_SCENES[scene]
    return {key.flag or key.path.split(".")[1]: key for key in keys}


def value_of(key: Key, word: str) -> Any:
    """The value of a sound word."""
    if key.path == "mesh.size":
        return [int(n) for n in word.split("x")]
    if key.path in ("loads.force_N", "scene.move_mm", "scene.roller_deg"):
        side, _, numbers = word.partition("=")
        values = [toml(number) for number in numbers.split(",")]
        return {side: values if len(values) > 1 else values[0]}
    return [word] if key.path == "scene.free" else toml(word)


def toml(word: str) -> Any:
    """A value of TOML, or the word itself."""
    try:
        return tomllib.loads(f"x = {word}")["x"]
    except ValueError:
        return word


# Folders of results and of checkpoints.
_BAD_FOLDERS = ("file", "file/x", "", "/proc/nothing", "a\0b", "a" * 300, "empty.vtu")
_BAD_CHECKPOINTS = ("junk", "file", "a\0b")
_FOLDERS = ("a/b/c", "there", ".", "x\ny", "é ü", "~", "\udcff")

# ------------------------------------------------------------------------------- lines


class Line(NamedTuple):
    """A line of the command line.

    ``values`` are by the paths of their keys; ``odd`` is a key and a word that may be
    taken, ``is_cut`` true if a word was deleted; ``checkpoint`` is a folder, empty for
    the folder of the results.
    """

    words: list[str]
    verdict: int
    values: Mapping[str, Any] = MappingProxyType({})
    odd: tuple[str, str] | None = None
    is_cut: bool = False
    scene: str = ""
    out: str = "out"
    checkpoint: str | None = None
    is_verbose: bool = False


def option(draw, key: Key, word: str) -> list[str]:
    """Words that set a key: its option, or ``--set``."""
    if not key.flag or (draw(st.integers(0, 9)) == 9 and "=" not in word):
        return ["--set", f"{key.path}={word}"]
    if word.startswith("-") or draw(st.booleans()):
        return [f"--{key.flag}={word}"]
    return [f"--{key.flag}", word]


@st.composite
def lines(draw, scene: str) -> Line:
    """A sound line to which at most one change is applied."""
    of, values, words = keys(scene), {}, []
    for name, word in draw(st.permutations(draw(sound_words(scene)))):
        value, path = value_of(of[name], word), of[name].path
        if isinstance(value, dict):
            value = values.get(path, {}) | value
        values[path] = value
        flag = of[name].flag
        words += [f"--{flag}={word}"] if flag else ["--set", f"{path}={word}"]
    line = Line(["run", scene, *words, "--no-render"], TAKEN, values, scene=scene)
    if contradicts(scene, values):
        line = line._replace(verdict=REFUSED)
    change = draw(st.sampled_from(CHANGES))
    line = change(draw, line)
    return line._replace(words=[*line.words, "--out", line.out])


def unchanged(draw, line):
    return line


def with_bad_word(draw, line):
    """A word that its key refuses."""
    key = draw(st.sampled_from([*keys(line.scene).values()]))
    words = option(draw, key, draw(st.sampled_from(key.bad.split("|"))))
    return line._replace(words=[*line.words, *words], verdict=REFUSED)


def with_odd_word(draw, line):
    """A word that the key may take; it then means what Python reads."""
    key, word = draw(st.sampled_from([*keys(line.scene).values()])), ""
    word = draw(st.sampled_from((*ODD, *SIDES, *MESHES, "89.9999", "720", "1e9")))
    words = [*line.words, *option(draw, key, word)]
    return line._replace(words=words, verdict=EITHER, odd=(key.path, word))


def malformed(draw, line):
    """An unknown option, one without its word, or one of another scene."""
    flags = {key.flag for key in keys(line.scene).values() if key.flag}
    every = {key.flag for of in _OF_SCENES.values() for key in of}
    strange = sorted(
        name for name in every if not any(flag.startswith(name) for flag in flags)
    )
    wrong = [
        *(["--steps="], ["--nothing"], ["--s"], ["--="], ["--paper=x"], ["--set", "x"]),
        *(["--set", "x.y"], ["--checkpoint", "one", "--resume", "two"]),
        *([f"--{flag}"] for flag in sorted(flags)),
        *([f"--{flag}", "1"] for flag in strange),
    ]
    words = [*line.words, *draw(st.sampled_from(wrong))]
    return line._replace(words=words, verdict=REFUSED)


def with_checkpoint(draw, line):
    folder = draw(st.sampled_from(("", "kept", *_BAD_CHECKPOINTS)))
    word = draw(st.sampled_from(("--checkpoint", "--resume")))
    verdict = REFUSED if folder in _BAD_CHECKPOINTS else line.verdict
    words = [*line.words, *([word, folder] if folder else [word])]
    return line._replace(words=words, verdict=verdict, checkpoint=folder)


def elsewhere(draw, line):
    """Another folder of the results."""
    out = draw(st.sampled_from((*_FOLDERS, *_BAD_FOLDERS, "blocked")))
    verdict = line.verdict if out in _FOLDERS else REFUSED
    return line._replace(out=out, verdict=verdict)


def verbose(draw, line):
    word = draw(st.sampled_from(("-v", "-vv", "--verbose")))
    return line._replace(words=[*line.words, word], is_verbose=True)


def cut(draw, line):
    """A line without one of its words."""
    i = draw(st.integers(0, len(line.words) - 1))
    words = line.words[:i] + line.words[i + 1 :]
    return line._replace(words=words, verdict=EITHER, is_cut=True)


#: Changes of a line by frequency.
CHANGES = (
    *(unchanged, unchanged, with_bad_word, with_bad_word, with_odd_word, with_odd_word),
    *(malformed, with_checkpoint, elsewhere, verbose, cut),
)

#: Keys of meshes that are not graded.
OF_GRID = frozenset(("mesh.size", "mesh.jitter", "mesh.seed"))


def kind_of_mesh(scene, values):
    """The source of the mesh of a line."""
    is_graded = scene not in ("strip", "trellis") and not OF_GRID & values.keys()
    return values.get("mesh.source", GRADED if is_graded else "irregular")


def formulation(values):
    """The name of the formulation of a line."""
    others = any(key.startswith("formulation.") for key in values)
    return values.get("formulation.name", "macro" if others else "auto")


def contradicts(scene, values):
    """True if sound words contradict one another."""
    name, is_graded = formulation(values), kind_of_mesh(scene, values) == GRADED
    return (
        ("mesh.density" in values and not is_graded)
        or (values.get("mesh.as_is", False) and is_graded)
        or (name != "one-point" and "formulation.stabilisation" in values)
        or (name in ("full", "quadratic") and "formulation.cs_N_per_mm" in values)
        or (name != "quadratic" and "formulation.deviation" in values)
    )


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
        ("as_is", one("true", "true", "false")),
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


_BAD = ("0", "-1", "nan", "1.5", "", "x", "²", "9" * 5000, "\0")


@st.composite
def other_lines(draw) -> Line:
    """A line that runs nothing, or that must be rejected."""
    bad, scene = draw(st.sampled_from(_BAD)), draw(st.sampled_from(SCENES))
    answered = ["list"], ["--version"], ["run", scene, "--help"], ["run", scene, "-h"]
    out = ["--out", "out"]
    refused = (
        *(["list", bad], [], [bad], ["run"], ["run", bad, *out], ["run", scene]),
        *(["Run", scene, *out], ["run", *out, "--steps", "1"]),
        *(["run", scene, bad, *out], ["run", scene, *out, "--help", "nothing"]),
    )
    words = draw(st.sampled_from((*answered, *refused)))
    return Line(words, EITHER if words in answered else REFUSED)


def any_line() -> dict[str, st.SearchStrategy]:
    """Lines of each scene, and others; one in thirty."""
    scenes = {f"{n} {s}": lines(s) for n in range(6) for s in SCENES}
    return scenes | {"other": other_lines()}


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
