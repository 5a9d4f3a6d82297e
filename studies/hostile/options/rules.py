"""Which command lines must be refused, and which may be."""

import os
from math import isfinite, pi, radians, sin, tan
from pathlib import Path
from typing import Any

from .documented import JITTER, KINDS, OF_OTHER_LAWS, SEED, UNNAMED, UnreadableError
from .reader import RunLine

#: Stiffnesses, in N/mm, beyond which products of them may overflow, or underflow.
_LARGE, _SMALL = 1e20, 1e-20

#: Jitter, as a share of the spacing, beyond which an element may be inverted.
_DISTORTED = 0.3

#: Elements that need more memory than a worker has.
_TOO_MANY = 10**9


def refuse_contradictions(line: RunLine) -> None:
    """Raise `UnreadableError` if the line must be refused."""
    values = line.values
    _refuse_folder(values["out"])
    if (Path(values["out"]) / "summary.json").is_dir():
        raise UnreadableError("there is a folder in the place of a file")
    _refuse_mesh(line)
    _refuse_numbers(values)
    _refuse_stiffness(values["fibre-pretension"])
    if any(values[name] != one.default for name, one in OF_OTHER_LAWS.items()):
        raise UnreadableError("a parameter of another law")
    _refuse_formulation(values)
    _refuse_checkpoint(values)
    _refuse_edges(values)
    _refuse_moves(line)
    if not _round_off_decides(values):
        _refuse_fibres(line)


def may_be_refused(line: RunLine) -> bool:
    """Whether a run may be refused or not, because its numbers are extreme."""
    v = line.values
    names = (
        *("fibre-stiffness", "shear-stiffness", "bending-warp", "bending-weft"),
        *("bending-twist", "cs", "deviation"),
    )
    if v["fibre-pretension"]:  # which the law may not reach
        return True
    numbers = [v[name] for name in names if v[name] not in (None, "auto", 0)]
    odd = any(not _SMALL < number < _LARGE for number in numbers)
    theta = v["warp"] if line.scene == "bias_extension" else 45.0
    distorted = v["mesh"] in KINDS and mesh_to_make(line)[1] > _DISTORTED
    same = os.path.abspath(v["out"]) in {
        os.path.abspath(v[name])
        for name in ("checkpoint", "resume")
        if v[name] not in (None, UNNAMED)
    }
    if line.scene == "specimen" and _unusual(v):
        return True
    return odd or distorted or same or _round_off_decides(v) or not 15 < theta < 75


def _unusual(v: dict[str, Any]) -> bool:
    """Whether fibres, sides or moves of a specimen may contradict one another."""
    parallel = abs(sin(radians(v["weft"] - v["warp"]))) < 0.1
    usual = {side: v[side] for side in ("width", "height")} == {
        "width": 50.0,
        "height": 100.0,
    }
    return parallel or not usual or len(v["move"]) != 2


def _round_off_decides(v: dict[str, Any]) -> bool:
    """Whether angles are so large that round-off decides whether they are valid."""
    angles = [abs(v.get(name, 0.0)) for name in ("warp", "weft", "shear-angle", "bend")]
    return max(angles) > 1e4


def mesh_to_make(line: RunLine) -> tuple[list[int], float, int]:
    """Size, jitter and seed of the mesh that is made."""
    v = line.values
    jitter = JITTER[line.scene] if v["jitter"] is None else v["jitter"]
    return v["size"], jitter, SEED if v["seed"] is None else v["seed"]


def _refuse_folder(word: str) -> None:
    """Refuse a path at which there is no folder and none can be made."""
    path = os.path.abspath(word)
    try:
        longest = max(len(os.fsencode(part)) for part in Path(path).parts)
    except UnicodeEncodeError as error:
        raise UnreadableError(str(error)) from None
    if "\0" in word or longest > 255:
        raise UnreadableError("no path")
    while not os.path.lexists(path):
        path = os.path.dirname(path)
    if not os.path.isdir(path) or not os.access(path, os.W_OK) or "/proc" in path:
        raise UnreadableError(f"{path} is no folder that can be written")


def _refuse_mesh(line: RunLine) -> None:
    v = line.values
    if v["mesh"] in KINDS:
        nx, ny = v["size"]
        if min(nx, ny) < 1 or nx * ny > _TOO_MANY:
            raise UnreadableError("size")
        _, jitter, seed = mesh_to_make(line)
        if not 0 <= jitter < 1:
            raise UnreadableError("jitter")
        if seed < 0:
            raise UnreadableError("seed")
        return
    if "\0" in v["mesh"] or not os.path.isfile(v["mesh"]):
        raise UnreadableError("no such mesh")
    if not v["mesh"].endswith("good.vtu"):
        raise UnreadableError("no mesh in the file")
    if {"size", "jitter", "seed"} & line.given:
        raise UnreadableError("the mesh is mesh_to_make, or read")


def _refuse_numbers(v: dict[str, Any]) -> None:
    of_bending = "bending-warp", "bending-weft", "bending-twist"
    for name in ("fibre-stiffness", "shear-stiffness", *of_bending):
        _refuse_stiffness(v[name])
    if v["fibre-stiffness"] == v["shear-stiffness"] == 0:
        raise UnreadableError("no stiffness")
    if not 0 < v["shear-wrinkling-angle"] <= 90:
        raise UnreadableError("wrinkling angle")
    if not 1 <= v["steps"] <= 1_000_000:
        raise UnreadableError("steps")
    _refuse_forces(v)


def _refuse_forces(v: dict[str, Any]) -> None:
    names = [name for name, _ in v["force"]]
    if not set(names) <= {"left", "bottom", "right", "top"}:
        raise UnreadableError("no such boundary")
    if len(set(names)) < len(names):
        raise UnreadableError("two forces on one boundary")
    if not all(isfinite(x) for _, total in v["force"] for x in total):
        raise UnreadableError("force")


def _refuse_stiffness(number: float) -> None:
    if not (isfinite(number) and number >= 0):
        raise UnreadableError("stiffness")


def _refuse_formulation(v: dict[str, Any]) -> None:
    name, kind = v["formulation"], v["stabilisation"]
    if kind != "energy" and (name != "one-point" or v["cs"] == "auto"):
        raise UnreadableError("stabilisation")
    if v["cs"] != "auto":
        if name not in ("one-point", "macro"):
            raise UnreadableError("cs")
        _refuse_stiffness(v["cs"])
    if v["deviation"] is not None:
        if name != "quadratic":
            raise UnreadableError("deviation")
        _refuse_stiffness(v["deviation"])


def _refuse_checkpoint(v: dict[str, Any]) -> None:
    named = {v[name] for name in ("checkpoint", "resume")} - {None, UNNAMED}
    if len(named) > 1:
        raise UnreadableError("two folders")
    for folder in named:
        _refuse_folder(folder)
        if os.path.basename(folder) == "junk":
            raise UnreadableError("no checkpoint")


def _refuse_moves(line: RunLine) -> None:
    """Refuse a curve of a test that is none, and moves that nobody can mean."""
    v = line.values
    if v["test-curve"] not in (None, "curve.csv"):
        raise UnreadableError("no curve of a test")
    if line.scene != "specimen":
        return
    moves = v["move"]
    names = [name for name, _ in moves]
    if not set(names) <= {"top", "right", "bottom", "left"}:
        raise UnreadableError("no such boundary")
    if len(set(names)) < len(names):
        raise UnreadableError("a boundary is moved twice")
    if not all(isfinite(x) for _, move in moves for x in move if x != "free"):
        raise UnreadableError("move")
    moved = [name for name, move in moves if move != ["free", "free"]]
    if not moved or v["driven"] not in (None, *moved):
        raise UnreadableError("nothing is moved, or not what is driven")
    if v["mesh"] in KINDS and not all(
        isfinite(v[side]) and v[side] > 0 for side in ("width", "height")
    ):
        raise UnreadableError("sides")


def _refuse_fibres(line: RunLine) -> None:
    v = line.values
    if line.scene == "picture_frame" and not abs(v["shear-angle"]) < 90:
        raise UnreadableError("the frame closes")
    if line.scene == "trellis":
        _refuse_trellis(v)
    if line.scene == "bias_extension":
        theta = v["warp"] % 180
        if abs(theta + v["weft"] % 180 - 180) > 1e-7 or not 1e-4 < theta < 89.9999:
            raise UnreadableError("fibres")
        if not 0 < v["shear-angle"] < 180 - 2 * theta:
            raise UnreadableError("shear angle")
        wide = 2 if v["part"] == "half" else 1
        if v["mesh"] not in KINDS and tan(radians(theta)) * wide > 1.0000001:
            raise UnreadableError("the mesh is no such ply")


def _refuse_trellis(v: dict[str, Any]) -> None:
    """Refuse fibres that are parallel, or fold onto one another somewhere."""
    crossing = radians(v["weft"]) - radians(v["warp"])
    if abs(sin(crossing)) < 1e-6:
        raise UnreadableError("parallel fibres")
    crossing = (crossing + pi) % (2 * pi) - pi
    sign = 1 if crossing > 0 else -1
    inverse = 1 / sin(crossing)
    for x in (0, 100):
        for y in (0, 100):
            s1 = (sin(radians(v["weft"])) * x - _cos(v["weft"]) * y) * inverse
            s2 = (_cos(v["warp"]) * y - sin(radians(v["warp"])) * x) * inverse
            gamma = radians(v["shear-angle"]) - radians(v["bend"]) * (s1 + s2) / 100
            if not 0 < sign * (crossing - gamma) < pi:
                raise UnreadableError("fibres fold")


def _cos(degrees: float) -> float:
    return sin(radians(degrees + 90))


def _refuse_edges(v: dict[str, Any]) -> None:
    free = v.get("free", [])
    rollers = v.get("roller", [])
    sides = [side for side, _ in rollers]
    if not set(sides) <= {"top", "right", "bottom", "left"}:
        raise UnreadableError("no such side")
    if len(set(sides)) < len(sides) or set(sides) & set(free):
        raise UnreadableError("a side is carried twice")
    if not all(isfinite(angle) for _, angle in rollers):
        raise UnreadableError("roller")
    if len({*free, *sides}) == 4:
        raise UnreadableError("no side is held")
