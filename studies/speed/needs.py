"""Only what a scene needs: time saved without some terms, pictures and packages.

It measures the set-up and an iteration of plies that need less and less, and imports,
each in a new process.
"""

import subprocess
import sys
from statistics import median
from typing import Any

from numpy import ndarray

from skfem_textile import Fabric, Full, OnePoint, Ply

from ..common.tables import markdown_table
from ..study import Row
from .measuring import Settings, seconds, strip_of

TABLES = "needs.md", "imports.md"

#: Plies by what they need.
PLIES: dict[str, tuple[Fabric, OnePoint | Full]] = {
    "tension, shear, stabilisation": (Fabric(1e4, 0.5), OnePoint(4.0)),
    "tension, stabilisation": (Fabric(1e4), OnePoint(4.0)),
    "tension, shear": (Fabric(1e4, 0.5), OnePoint(0.0)),
    "tension": (Fabric(1e4), OnePoint(0.0)),
    "tension at 2×2 points": (Fabric(1e4), Full()),
}

_IMPORTS = "skfem", "skfem_textile", "skfem_textile.scenes", "skfem_textile.plot"

_SIZE, _ROUNDS = 20_000, 7


def measured(settings: Settings) -> Row:
    """Medians of the seconds of plies, also as shares of the first, and of imports."""
    scene = strip_of(min(_SIZE, settings.most))
    times: dict[str, tuple[list[float], list[float]]] = {n: ([], []) for n in PLIES}
    for number in range(1 + _ROUNDS):
        for name, given in PLIES.items():
            ply, built = seconds(Ply, scene.mesh, *given)
            u = (1 + 1e-9 * number) * scene.displacement(ply.nodes, 0.2).T.ravel()
            _assembled(ply, u)
            _, took = seconds(_assembled, ply, (1 + 1e-9) * u)
            if number:
                times[name][0].append(built)
                times[name][1].append(took)
    most = [median(x) for x in next(iter(times.values()))]
    plies = {}
    for name, columns in times.items():
        values = [median(x) for x in columns]
        shares = [x / y for x, y in zip(values, most, strict=True)]
        plies[name] = {"seconds": values, "shares": shares}
    imports = {}
    for name in _IMPORTS:
        _imported(name)  # once, to load it into the file cache
        imports[name] = median(_imported(name) for _ in range(_ROUNDS))
    return {"elements": scene.mesh.nelements, "plies": plies, "imports": imports}


def _assembled(ply: Ply, u: ndarray) -> Any:
    """Forces and tangent."""
    return ply.residual(u), ply.stiffness(u)


def _imported(name: str) -> float:
    """Seconds to import a package in a new process."""
    code = (
        "from time import perf_counter as now; start = now(); "
        f"import {name}; print(now() - start)"
    )
    child = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    return float(child.stdout)


def tables(results: Row) -> dict[str, str]:
    """A line for each ply, and one for each import."""
    plies = [
        [name, *(f"{share:.2f}" for share in ply["shares"])]
        for name, ply in results["plies"].items()
    ]
    skfem = results["imports"]["skfem"]
    imports = [
        [f"`import {name}`", f"{took:.3f}", f"{took / skfem:.2f}"]
        for name, took in results["imports"].items()
    ]
    head = ["", "set-up, share", "forces and tangent, share"]
    return {
        "needs.md": markdown_table(head, plies),
        "imports.md": markdown_table(["", "s", "share of skfem's"], imports),
    }
