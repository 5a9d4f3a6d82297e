"""Compares the results of a run with its command line."""

import csv
import json
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy import ndarray
from skfem import MeshTri

from skfem_textile.scenes.rectangle import rectangle

from ..semantics import bilinear
from ..trial import WrongAnswerError
from . import edge_motions
from .documented import KINDS, UNNAMED
from .reader import RunLine
from .rules import mesh_to_make

#: Options without influence on the result.
_OTHERS = {"out", "no-render", "checkpoint", "resume", "verbose"}

#: By how much a number may be off, as a share of the largest of its kind.
_TOLERANCE = 1e-7

_PICTURES = ("fibre_strain.png", "shear_angle.png", "load.png", "animation.gif")


def check_results(line: RunLine, converged: bool) -> None:
    """Compare what was written with what the line says.

    Raises
    ------
    WrongAnswerError
        If they differ.
    """
    out = Path(line.values["out"])
    text = (out / "summary.json").read_text()
    summary = json.loads(text, parse_constant=_refuse_constant)
    with open(out / "history.csv", newline="") as file:
        history = list(csv.DictReader(file))
    _check_inputs(line, summary)
    _check_history(line, summary, history, converged)
    if not line.values["no-render"]:
        for name in _PICTURES:
            if not (out / name).stat().st_size:
                raise WrongAnswerError(f"no {name}")
    first = meshio.read(out / "fields" / "step_0000.vtu")
    last = meshio.read(out / "fields" / f"step_{summary['load_steps']:04d}.vtu")
    _check_mesh(line, summary, first)
    _check_fields(line, first, last)
    _check_motion(line, last, summary["load_factor"])
    _check_energies(line, summary, last)
    _check_forces(line, summary, last)
    _check_checkpoint(line, out, summary["load_steps"])


def _refuse_constant(constant: str) -> None:
    raise WrongAnswerError(f"{constant} in summary.json")


def _expect(what: str, value: Any, expected: Any) -> None:
    if value != expected:
        raise WrongAnswerError(f"{what}: {value}, expected {expected}")


def _expect_near(what: str, value: Any, expected: Any, size: float) -> None:
    off = float(np.abs(np.asarray(value) - expected).max())
    if not off <= _TOLERANCE * size + 1e-300:
        raise WrongAnswerError(f"{what}: {value}, expected {expected}, off by {off}")


def _check_inputs(line: RunLine, summary: dict[str, Any]) -> None:
    expected = {k: v for k, v in line.values.items() if k not in _OTHERS}
    if expected["mesh"] in KINDS:
        names = zip(("size", "jitter", "seed"), mesh_to_make(line), strict=True)
        expected.update(names)
    inputs = {k: v for k, v in summary["inputs"].items() if k != "version"}
    expected = {k.replace("-", "_"): v for k, v in expected.items()}
    drawn = not line.values["no-render"]
    also = {"scene": line.scene, "regions": {}, "pictures": drawn}
    also |= {"weft_tension": None, "tension_in_compression": None}
    _expect("inputs", inputs, {**also, **expected})
    _expect("scene", summary["scene"], line.scene)
    _expect("formulation", summary["formulation"], line.values["formulation"])
    empty = {k for k, v in summary.items() if v is None} - {"negative_pivots"}
    if summary["error_estimate"].startswith("none: "):
        empty -= {"estimated_load_error", "estimated_shear_angle_error_deg"}
    _expect("numbers that are none", empty, set())


def _as_written(number: float) -> float:
    """A number as files have it, with twelve digits."""
    return float(f"{number:.12g}")


def _check_history(
    line: RunLine,
    summary: dict[str, Any],
    history: list[dict[str, str]],
    converged: bool,
) -> None:
    _expect("converged", summary["converged"], converged)
    _expect("rows", len(history), summary["load_steps"] + 1)
    reached = [float(row["load_factor"]) for row in history]
    _expect("load factor", reached[-1], _as_written(summary["load_factor"]))
    _expect("the whole load", reached[-1] == 1.0, converged)
    n = line.values["steps"]
    requested = map(_as_written, np.linspace(0, 1, n + 1).tolist())
    wanted = {t for t in requested if t <= reached[-1]}
    _expect("load factors that are not there", wanted - set(reached), set())
    ending = "_reaction_x"
    names = {k.removesuffix(ending) for k in history[0] if k.endswith(ending)}
    _expect("conditions", names, edge_motions.conditions(line))


def _check_forces(line: RunLine, summary: dict[str, Any], last: meshio.Mesh) -> None:
    """Check the potential −F·u of a force, u the mean displacement of its side."""
    X, u = _turned(line, last.points), _turned(line, last.point_data["displacement"])
    for side, total in line.values["force"]:
        across, end = (0, 1) if side in ("left", "right") else (1, 0)
        edge = X[across].max() if side in ("right", "top") else X[across].min()
        on = np.flatnonzero(np.abs(X[across] - edge) < 1e-9 * np.ptp(X[across]))
        on = on[np.argsort(X[end, on])]
        length = np.diff(X[end, on])
        mean = (u[:, on[1:]] + u[:, on[:-1]]) @ length / (2 * length.sum())
        potential = -summary["load_factor"] * float(mean @ total)
        written = summary[f"force on {side}_potential"]
        size = np.abs(total).max() * np.abs(u).max()
        if line.values["formulation"] != "quadratic":
            _expect_near(f"force on {side}", written, potential, size)


def _turned(line: RunLine, x: ndarray) -> ndarray:
    """Vectors of a file, shape (n, 3), in the scene before it is rotated, (2, n)."""
    a = -np.radians(line.values["rotate"])
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    return turn @ x.T[:2]


def _check_mesh(line: RunLine, summary: dict[str, Any], first: meshio.Mesh) -> None:
    v, X = line.values, _turned(line, first.points)
    if v["mesh"] in KINDS:
        (nx, ny), jitter, seed = mesh_to_make(line)
        sides, angles = edge_motions.sides(line), edge_motions.fibres(line)
        made = rectangle(*sides, (nx, ny), v["mesh"], jitter, seed, *angles)
        points, triangles = made.p, isinstance(made, MeshTri)
        least = made.nelements
    else:
        given = meshio.read(v["mesh"])
        points, triangles = given.points.T[:2], "triangle" in given.cells_dict
        least = len(given.cells[0].data)
    _expect_near("nodes", X[:, : points.shape[1]], points, np.abs(points).max())
    parts = [1, 1]
    if v["formulation"] == "quadratic":
        parts = [1, 1] if triangles else [2, 2]
    elif triangles:
        parts = [3, 3]
    elif v["formulation"] == "macro":
        parts = [4, 6]  # what is not convex is cut first
    n = summary["n_elements"]
    if not parts[0] * least <= n <= parts[1] * least:
        raise WrongAnswerError(f"{n} elements of {least} that were given")
    _expect("cells of the file", sum(len(c.data) for c in first.cells), n)


def _check_fields(line: RunLine, first: meshio.Mesh, last: meshio.Mesh) -> None:
    """Check inclinations of the fibres at rest, and tension against strain."""
    v = line.values
    if v["fibre-compression"] == "none" or v["fibre-pretension"]:
        return  # tension at rest, which a smooth switch leaves too, moves the fibres
    pointwise = v["formulation"] != "macro" and v["deviation"] is None
    angles = edge_motions.fibres(line)
    for family, angle in zip(("warp", "weft"), angles, strict=True):
        direction = _turned(line, first.cell_data[f"{family}_direction"][0])
        expected = np.array([[np.cos(angle)], [np.sin(angle)]])
        _expect_near(f"{family} at rest", direction, expected, 1.0)
        strain = last.cell_data[f"{family}_strain"][0]
        tension = last.cell_data[f"{family}_tension"][0]
        E = v["fibre-stiffness"]
        if pointwise:
            _expect_near(f"{family} tension", tension, E * strain, E)


def _check_motion(line: RunLine, last: meshio.Mesh, t: float) -> None:
    X, u = (_turned(line, x) for x in (last.points, last.point_data["displacement"]))
    off = edge_motions.misplaced(line, X, u, t)
    if not off <= 1e-6:
        raise WrongAnswerError(f"an edge is off by {off} mm")


def _check_energies(line: RunLine, summary: dict[str, Any], last: meshio.Mesh) -> None:
    v, name = line.values, line.values["formulation"]
    if name == "quadratic":
        return  # the files do not hold the nodes at the middles of edges
    X, u = (_turned(line, x) for x in (last.points, last.point_data["displacement"]))
    mesh = X, X + u, last.cells[0].data.T, edge_motions.fibres(line)
    E, G, sine = v["fibre-stiffness"], v["shear-stiffness"], v["shear-law"] == "sin2"
    tension, shear = bilinear.energies(*mesh, E, (G, sine), name != "full")
    scale = E * bilinear.areas(X, mesh[2]).sum()
    as_given = v["fibre-compression"] == "law" and not v["fibre-pretension"]
    if name != "macro" and as_given:
        _expect_near("tension", summary["tension_energy"], tension, 1e-3 * scale)
        _expect_near("tension", summary["tension_energy"], tension, tension + 1e-9 * E)
    _expect_near("shear", summary["shear_energy"], shear, shear + 1e-9 * G)
    C_s, kind = v["cs"], v["stabilisation"]
    if C_s == "auto" or kind in ("rate", "continuity"):
        return
    held = (
        bilinear.isotropic(*mesh[:3], C_s)
        if kind == "isotropic"
        else bilinear.hourglass(*mesh, C_s)
    )
    _expect_near("held", summary["stabilisation_energy"], held, held + 1e-9 * C_s)


def _check_checkpoint(line: RunLine, out: Path, load_steps: int) -> None:
    v = line.values
    named = {v["checkpoint"], v["resume"]} - {None, UNNAMED}
    if v["checkpoint"] is v["resume"] is None:
        _expect("a checkpoint", (out / "checkpoint").exists(), False)
        return
    folder = Path(named.pop()) if named else out / "checkpoint"
    _expect("kept states", len(list(folder.glob("state_*.npz"))), load_steps + 1)
