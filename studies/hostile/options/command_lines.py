"""Random command lines: mostly sound, with a word or two that are not."""

from collections.abc import Callable
from random import Random

from .documented import KINDS, OPTIONS, UnreadableError
from .reader import AskedError, read

#: Words that few options take.
_ODD = (
    *("nan", "inf", "-inf", "-1", "0", "-0", "0.0", "1e308", "-1e308", "1e400"),
    *("1e-320", "1e20", "-1e-5", "99999999999999999999999", "", " ", " 2 ", "+1"),
    *("1_0", "1,5", "0x10", "1e", "1+2j", "2.0", "٢", "２", "½", "∞", "−1", "é"),
    *("None", "True", "auto", "-", "--", "---", "-x", "-v", "a b", "a\nb", "\t"),
    *("\x1b[2J", "\0", "\ud800", "\udcff", "\u202e", "🧵", "%s", "{0}", "%(prog)s"),
    *("x" * 300, "9" * 5000, "..", "~", "$HOME", "*", "@file", "left", "mixed"),
)

_SIZES = (
    *("0x5", "-1x5", "6x9x2", "10", "x", "3x", "3X4", "3×4", "２x２", "1_0x1", "2 x 3"),
    *("1e1x2", "nanxnan", "2.0x3", "1x1", "100000x100000", "1000000x1000000"),
    *("99999999999999999999999x1", "1x99999999999999999999999", "0x0", "-2x-2"),
)
_STEPS = ("0", "-1", "1000001", "10000000000000000000000", "1.5", "2e0", "1", "２")
_MESHES = (
    *("curly", "Irregular", "missing.msh", "folder", "junk.msh", "junk.vtu"),
    *(
        "empty.vtu",
        "quads good.vtu",
        "triangles good.vtu",
        "quads good.vtu",
        "junk.inp",
        ".",
    ),
)
_FOLDERS = (
    *("out", "a/b/c", "there", "file", "file/x", "", "/proc/nothing", "blocked", "."),
    *("x\ny", "é ü", "\udcff", "a\0b", "a" * 300, "quads good.vtu", "~", "junk"),
)
_ANGLES = ("90", "89.9999", "180", "360", "-45", "1e-9", "45.0000000001", "720", "1e9")
_ROLLERS = (
    *("left=30", "top=nan", "lid=3", "left", "=", "left=", "=3", "right=inf"),
    *("left=30", "top=-20", "bottom=1e308", "right=90", "left=3=4"),
)

_FORCES = (
    *("top=1,2", "right=-0.5,0.1", "lid=1,2", "top=nan,0", "top=1e308,0", "=1,2"),
    *("top", "top=1", "top=1,2,3", "left=inf,0", "right=0,0", "bottom=1_0,-0"),
)

_MOVES = (
    *("top=0,5", "bottom=0,0", "left=free,free", "right=free,0", "lid=0,0", "top"),
    *("top=1", "top=1,2,3", "top=nan,0", "top=fre,1", "=0,1", "top=1e308,0"),
)
_CURVES = ("curve.csv", "missing.csv", "junk.inp", "folder", "curve.csv\0", "")

#: Scenes that are drawn more often, and a study, which is no scene.
_OFTEN = ("strip", "trellis", "bias_extension")
_NO_SCENE = "two_element"


def random_line(random: Random) -> list[str]:
    """A command line that may be damaged."""
    return _study(random) if random.random() < 0.03 else _run(random)


def sound_line(random: Random) -> list[str]:
    """A sound line of a run with pictures."""
    scene = random.choice(list(OPTIONS))
    words = ["run", scene, "--out", "out", "--size", "2x2", "--steps", "1"]
    return [*words, "--shear-stiffness", "0.5", "--jitter", "0.1"]


def _run(random: Random) -> list[str]:
    scene = random.choice([*OPTIONS, _NO_SCENE, *_OFTEN])
    out = "out" if random.random() < 0.85 else random.choice(_FOLDERS)
    parts = [["--out", out], ["--no-render"]]
    if scene in OPTIONS:
        parts += [["--steps", random.choice("12")], _size(random)]
        parts += _sound_parts(scene, random)
    for _ in range(random.choice((0, 0, 1, 1, 1, 2, 3))):
        parts.insert(random.randrange(len(parts) + 1), _odd_part(scene, random))
    if random.random() < 0.06 and ["--steps", "1"] in parts:
        parts.append(["--paper", "--rotate", "nan"])
    random.shuffle(parts)
    words = ["run", scene, *(word for part in parts for word in part)]
    if random.random() < 0.04:
        del words[random.randrange(len(words))]
    return words + _words_for_speed(words)


def _words_for_speed(words: list[str]) -> list[str]:
    """Words that keep a readable line from running for long."""
    try:
        _, values, given = read([word for word in words if word != "--"])
    except (UnreadableError, AskedError):
        return []
    more = [] if "no-render" in given else ["--no-render"]
    if "steps" not in given:
        more += ["--steps", "1"]
    if values["mesh"] in KINDS and "size" not in given:
        more += ["--size", "2x2"]
    return more


def _size(random: Random) -> list[str]:
    if random.random() < 0.07:
        return ["--mesh", random.choice(("quads good.vtu", "triangles good.vtu"))]
    return ["--size", f"{random.randint(1, 4)}x{random.randint(1, 6)}"]


def _sound_parts(scene: str, random: Random) -> list[list[str]]:
    """Options with values that go together."""
    parts = [
        ["--fibre-stiffness", random.choice(("1e4", "100", "1e3"))],
        ["--shear-stiffness", random.choice(("0", "0.5", "2", "10"))],
        ["--bending-warp", random.choice(("0", "0.5", "10"))],
        ["--shear-law", random.choice(("linear", "sin2"))],
        ["--rotate", random.choice(("30", "-77.5", "0", "180"))],
        ["--method", random.choice(("newton", "plain"))],
        ["--warn-only", *random.choice(([], ["work"], ["stability", "corners"]))],
        ["--solver", random.choice(("superlu", "cholmod", "auto"))],
        random.choice((["--checkpoint"], ["--checkpoint", "kept"], ["--resume"])),
        [random.choice(("-v", "-vv", "--verbose"))],
        ["--force", random.choice(("right=0.5,0.2", "top=-0.3,0.1"))],
    ]
    chosen = random.sample(parts, random.randint(0, 5))
    more = _mesh(random) + _formulation(scene, random) + _of_scene(scene, random)
    return chosen + more


def _mesh(random: Random) -> list[list[str]]:
    parts = [
        ["--mesh", random.choice(("aligned", "horizontal", "vertical", "delaunay"))],
        ["--seed", str(random.randint(0, 10**6))],
        ["--jitter", random.choice(("0", "0.1", "0.2"))],
    ]
    return random.sample(parts, random.randint(0, 3))


def _formulation(scene: str, random: Random) -> list[list[str]]:
    # Jumps between few elements leave zero-energy modes: other scenes take long.
    kind = "continuity" if scene == "picture_frame" else "isotropic"
    return random.choice(
        (
            *([], [], [["--formulation", "one-point"]], [["--cs", "4"]]),
            [["--formulation", "full"]],
            [["--formulation", "quadratic"]],
            [["--formulation", "quadratic"], ["--deviation", "20"]],
            [["--formulation", "one-point"], ["--cs", "auto"]],
            [["--formulation", "macro"], ["--cs", "2.5"]],
            *(
                [["--formulation", "one-point"], ["--stabilisation", k], ["--cs", "3"]]
                for k in ("isotropic", "rate", kind)
            ),
        )
    )


def _of_scene(scene: str, random: Random) -> list[list[str]]:
    angle = str(random.randint(5, 50))
    if scene == "picture_frame":
        return random.choice(([], [["--shear-angle", angle]]))
    if scene == "bias_extension":
        warp = random.randint(30, 60)
        fibres = [["--warp", str(warp)], ["--weft", str(180 - warp)]]
        more = random.choice(([], [["--part", "half"]], [["--shear-angle", "20"]]))
        return random.choice(([], fibres)) + more
    if scene == "specimen":
        return random.choice(
            (
                *([], [["--driven", "top"]], [["--move", "top=0,5"], _HELD]),
                [["--move", "top=free,-3"], _HELD, ["--test-curve", "curve.csv"]],
                [["--warp", angle], ["--weft", "100"], ["--driven", "bottom"]],
                [["--width", "40"], ["--height", "120"]],
            )
        )
    if scene == "trellis":
        parts = [
            ["--warp", str(random.randint(-30, 30))],
            ["--weft", str(random.randint(70, 120))],
            ["--shear-angle", angle],
            ["--bend", str(random.randint(-20, 30))],
            ["--free", *random.sample(("top", "left", "bottom"), random.randint(1, 2))],
            ["--roller", f"right={random.randint(-80, 80)}"],
        ]
        return random.sample(parts, random.randint(0, 4))
    return []


# A side of a specimen that does not move.
_HELD = ["--move", "bottom=0,0"]


def _odd_part(scene: str, random: Random) -> list[str]:
    """An option, of any scene or none, with an odd word or without one."""
    own = [name for name in OPTIONS.get(scene, ["out"]) if name not in _NOT_DRAWN]
    name = random.choice(own)
    kind = random.random()
    if kind < 0.08:
        others = {n for of in OPTIONS.values() for n in of} - _TO_A_TOLERANCE
        name = random.choice(sorted(others))
    if kind > 0.95:
        return [random.choice(_ODD)]
    if kind > 0.92:
        odd = ("steps=", "nothing", "s", "=", "help", "paper x")
        return [f"--{random.choice(odd)}"]
    if kind > 0.84:
        name = name[: random.randint(1, len(name))]
    if kind > 0.80:
        return [f"--{name}"]
    word = _word(name, random)
    return [f"--{name}={word}"] if random.random() < 0.2 else [f"--{name}", word]


_WORDS: dict[str, Callable[[Random], str]] = {
    "size": lambda random: random.choice(_SIZES),
    "steps": lambda random: random.choice(_STEPS),
    "mesh": lambda random: random.choice(_MESHES),
    "out": lambda random: random.choice(_FOLDERS),
    "checkpoint": lambda random: random.choice(_FOLDERS),
    "resume": lambda random: random.choice(_FOLDERS),
    "roller": lambda random: random.choice(_ROLLERS),
    "formulation": lambda random: random.choice(("macro", "full", "Full", "quadratic")),
    "stabilisation": lambda random: random.choice(("rate", "isotropic", "magic")),
    "shear-law": lambda random: random.choice(("sin2", "sin", "linear")),
    "method": lambda random: random.choice(("newton", "plain", "magic")),
    "warn-only": lambda random: random.choice(("folding", "strain", "magic")),
    "solver": lambda random: random.choice(("superlu", "magic", "cholmod")),
    "part": lambda random: random.choice(("half", "third", "whole")),
    "free": lambda random: random.choice(("top", "lid", "left")),
    "force": lambda random: random.choice(_FORCES),
    "move": lambda random: random.choice(_MOVES),
    "driven": lambda random: random.choice(("top", "left", "lid")),
    "test-curve": lambda random: random.choice(_CURVES),
    "fibre-compression": lambda random: random.choice(("none", "law", "non")),
}
# A run to a tolerance makes meshes of its own, which no line tells.
_TO_A_TOLERANCE = {"tolerance", "most-unknowns"}
_NOT_DRAWN = {"no-render", *_TO_A_TOLERANCE}
_ANGLED = ("warp", "weft", "bend", "shear-angle", "rotate")


def _word(name: str, random: Random) -> str:
    if name in _ANGLED and random.random() < 0.4:
        return random.choice(_ANGLES)
    if name in _WORDS and random.random() < 0.7:
        return _WORDS[name](random)
    return random.choice(_ODD)


def _study(random: Random) -> list[str]:
    """A line that must be refused, or one that lists the scenes: studies take long."""
    out = ["--out", "out"]
    bad = random.choice(("0", "-1", "nan", "1.5", "", "x", "²", "9" * 5000, "\0"))
    return random.choice(
        (
            *(["list"], ["list", bad], [], [bad], ["run"], ["study"], ["--version"]),
            *(["run", bad], ["Run", "strip", *out], ["run", *out, "--steps", "1"]),
            *(["study", "stability"], ["study", bad, *out], ["study", "paper", *out]),
            ["study", "stability", *out, "--workers", bad],
            ["study", "error-time", *out],
            ["study", "error-time", "trellis", *out],
            ["study", "formulations", *out, "--size", "3x4"],
            ["study", "stability", *out, "--resume", bad],
            ["study", "formulations", "--out", "file"],
            ["study", "stability", "--out", random.choice(("", "file/x"))],
            ["study", "stability", "--out", "unfinished"],
        )
    )
