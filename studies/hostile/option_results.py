"""Whether the results of a run are those of the options as they read."""

import csv
import json
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy import ndarray

from skfem_textile.scenes.rectangle import rectangle

from . import bilinear, option_motions
from .mechanics import WrongError
from .option_names import KINDS, UNNAMED
from .option_reader import Read
from .option_rules import formulation, made

#: Options that decide no result.
_OTHERS = {"out", "no-render", "paper", "checkpoint", "resume", "verbose"}

#: How far a number may be off, as a share of the largest of its kind.
_OFF = 1e-7

_PICTURES = ("fibre_strain.png", "shear_angle.png", "load.png", "animation.gif")


def check_results(read: Read, converged: bool) -> None:
    """Compare what was written with what the line says.

    Raises
    ------
    WrongError
        If they differ.
    """
    out = Path(read.values["out"])
    if read.scene == "two_element":
        report = json.loads((out / "systems.json").read_text())
        _expect("systems", len(report["systems"]), 24)
        return
    text = (out / "summary.json").read_text()
    summary = json.loads(text, parse_constant=_refuse_constant)
    with open(out / "history.csv", newline="") as file:
        history = list(csv.DictReader(file))
    _check_inputs(read, summary)
    _check_history(read, summary, history, converged)
    if not read.values["no-render"]:
        for name in _PICTURES:
            if not (out / name).stat().st_size:
                raise WrongError(f"no {name}")
    first = meshio.read(out / "fields" / "step_0000.vtu")
    last = meshio.read(out / "fields" / f"step_{summary['load_steps']:04d}.vtu")
    _check_mesh(read, summary, first)
    _check_fields(read, first, last)
    _check_motion(read, last, summary["load_factor"])
    _check_energies(read, summary, last)
    _check_forces(read, summary, last)
    _check_checkpoint(read, out, summary["load_steps"])


def _refuse_constant(constant: str) -> None:
    raise WrongError(f"{constant} in summary.json")


def _expect(what: str, found: Any, expected: Any) -> None:
    if found != expected:
        raise WrongError(f"{what}: {found}, expected {expected}")


def _expect_near(what: str, found: Any, expected: Any, size: float) -> None:
    off = float(np.abs(np.asarray(found) - expected).max())
    if not off <= _OFF * size + 1e-300:
        raise WrongError(f"{what}: {found}, expected {expected}, off by {off}")


def _check_inputs(read: Read, summary: dict[str, Any]) -> None:
    expected = {k: v for k, v in read.values.items() if k not in _OTHERS}
    if expected["split"] is UNNAMED:
        expected["split"] = "triangles"
    if expected["mesh"] in KINDS:
        names = zip(("size", "jitter", "seed"), made(read), strict=True)
        expected.update(names)
    found = dict(summary["inputs"])
    found.pop("version")
    expected = {k.replace("-", "_"): v for k, v in expected.items()}
    _expect("inputs", found, {"scene": read.scene, **expected})
    _expect("scene", summary["scene"], read.scene)
    _expect("formulation", summary["formulation"], formulation(read.values))
    empty = {k for k, v in summary.items() if v is None} - {"negative_pivots"}
    _expect("numbers that are none", empty, set())


def _check_history(
    read: Read, summary: dict[str, Any], history: list[dict[str, str]], converged: bool
) -> None:
    _expect("converged", summary["converged"], converged)
    _expect("rows", len(history), summary["load_steps"] + 1)
    reached = [float(row["load_factor"]) for row in history]
    _expect("load factor", reached[-1], summary["load_factor"])
    _expect("the whole load", reached[-1] == 1.0, converged)
    n = read.values["steps"]
    wanted = {t for t in np.linspace(0, 1, n + 1).tolist() if t <= reached[-1]}
    _expect("load factors that are not there", wanted - set(reached), set())
    ending = "_reaction_x"
    names = {k.removesuffix(ending) for k in history[0] if k.endswith(ending)}
    _expect("conditions", names, option_motions.conditions(read))


def _check_forces(read: Read, summary: dict[str, Any], last: meshio.Mesh) -> None:
    """The potential −F·u of a force, by the mean displacement of a straight side."""
    X, u = _turned(read, last.points), _turned(read, last.point_data["displacement"])
    for side, total in read.values["force"]:
        across, end = (0, 1) if side in ("left", "right") else (1, 0)
        edge = X[across].max() if side in ("right", "top") else X[across].min()
        on = np.flatnonzero(np.abs(X[across] - edge) < 1e-9 * np.ptp(X[across]))
        on = on[np.argsort(X[end, on])]
        length = np.diff(X[end, on])
        mean = (u[:, on[1:]] + u[:, on[:-1]]) @ length / (2 * length.sum())
        potential = -summary["load_factor"] * float(mean @ total)
        found = summary[f"force on {side}_potential"]
        size = np.abs(total).max() * np.abs(u).max()
        if read.values["formulation"] != "quadratic":
            _expect_near(f"force on {side}", found, potential, size)


def _turned(read: Read, x: ndarray) -> ndarray:
    """Vectors of a file, shape (n, 3), in the scene before it is turned, (2, n)."""
    a = -np.radians(read.values["rotate"])
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    return turn @ x.T[:2]


def _check_mesh(read: Read, summary: dict[str, Any], first: meshio.Mesh) -> None:
    v, X = read.values, _turned(read, first.points)
    if v["mesh"] in KINDS:
        (nx, ny), jitter, seed = made(read)
        width, height = option_motions.sides(read)
        points = rectangle(width, height, (nx, ny), v["mesh"], jitter, seed).p
        least, triangles = nx * ny, v["mesh"] == "delaunay"
    else:
        given = meshio.read(v["mesh"])
        points, triangles = given.points.T[:2], "triangle" in given.cells_dict
        least = len(given.cells[0].data) // (2 if triangles else 1)
    _expect_near("nodes", X[:, : points.shape[1]], points, np.abs(points).max())
    parts = [1, 1]
    if formulation(v) == "quadratic":
        parts = [2, 2]
    elif triangles or v["split"] in ("triangles", UNNAMED):
        parts = [6, 6]
    elif v["split"] == "quads":
        parts = [4, 6]  # what is not convex is cut first
    n = summary["n_elements"]
    if not parts[0] * least <= n <= parts[1] * least:
        raise WrongError(f"{n} elements of {least} quadrilaterals")
    _expect("cells of the file", sum(len(c.data) for c in first.cells), n)


def _check_fields(read: Read, first: meshio.Mesh, last: meshio.Mesh) -> None:
    """Fibres at rest have the given inclination, and tension the given stiffness."""
    pointwise = formulation(read.values) != "macro" and read.values["deviation"] is None
    for family, angle in zip(
        ("warp", "weft"), option_motions.fibres(read), strict=True
    ):
        found = _turned(read, first.cell_data[f"{family}_direction"][0])
        expected = np.array([[np.cos(angle)], [np.sin(angle)]])
        _expect_near(f"{family} at rest", found, expected, 1.0)
        strain = last.cell_data[f"{family}_strain"][0]
        tension = last.cell_data[f"{family}_tension"][0]
        E = read.values["fibre-stiffness"]
        if pointwise:
            _expect_near(f"{family} tension", tension, E * strain, E)


def _check_motion(read: Read, last: meshio.Mesh, t: float) -> None:
    X, u = (_turned(read, x) for x in (last.points, last.point_data["displacement"]))
    off = option_motions.misplaced(read, X, u, t)
    if not off <= 1e-6:
        raise WrongError(f"an edge is off by {off} mm")


def _check_energies(read: Read, summary: dict[str, Any], last: meshio.Mesh) -> None:
    v, name = read.values, formulation(read.values)
    if name == "quadratic":
        return  # nodes at the middles of edges are in no file
    X, u = (_turned(read, x) for x in (last.points, last.point_data["displacement"]))
    mesh = X, X + u, last.cells[0].data.T, option_motions.fibres(read)
    E, G, sine = v["fibre-stiffness"], v["shear-stiffness"], v["shear-law"] == "sin2"
    tension, shear = bilinear.energies(*mesh, E, (G, sine), name != "full")
    scale = E * bilinear.areas(X, mesh[2]).sum()
    if name != "macro":
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


def _check_checkpoint(read: Read, out: Path, load_steps: int) -> None:
    v = read.values
    named = {v["checkpoint"], v["resume"]} - {None, UNNAMED}
    if v["checkpoint"] is v["resume"] is None:
        _expect("a checkpoint", (out / "checkpoint").exists(), False)
        return
    folder = Path(named.pop()) if named else out / "checkpoint"
    _expect("kept states", len(list(folder.glob("state_*.npz"))), load_steps + 1)
