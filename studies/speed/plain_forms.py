"""Bare forms, assembled by `asm`, compared with a `Ply`."""

from collections.abc import Callable, Sequence
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from skfem import MeshQuad, asm

from skfem_textile import (
    CENTRE,
    Fabric,
    Forms,
    HourglassBasis,
    OnePoint,
    Ply,
    hourglass,
    quad_basis,
    shear,
    tension,
)

from ..common.tables import Row, table
from .solving import Settings, spread

# Elements, and side of the mesh in mm.
_ELEMENTS, _SIDE = 22_500, 100.0

# Fibre, shear and stabilisation stiffness in N/mm, and size of displacements in mm.
_E, _G, _C_S, _SIZE = 1e4, 0.5, 5.0, 0.01

# Rounds in which the codes alternate.
_ROUNDS = 15

_PLY, _EACH, _SUMS = "ply", "each form by itself", "sum of the forms of a basis"

_Basis = tuple[Forms, Any]
_Code = tuple[Callable[[np.ndarray], Any], Callable[[np.ndarray], Any]]


def plain_forms(settings: Settings) -> Row:
    """One-point elements with stabilisation: residual, then tangent, of a new state.

    Processor time; the codes alternate, each with its own fabric and bases.
    """
    n = round(min(_ELEMENTS, settings.most) ** 0.5)
    x = np.linspace(0, _SIDE, n + 1)
    mesh = MeshQuad.init_tensor(x, x)
    ply = Ply(mesh, _fabric(), OnePoint(_C_S))
    codes: dict[str, _Code] = {
        _PLY: (ply.residual, ply.tangent),
        _EACH: _by_forms(_each(mesh)),
        _SUMS: _by_forms(_sums(mesh)),
    }
    random = np.random.default_rng(0)
    times: dict[str, list[list[float]]] = {name: [] for name in codes}
    for _ in range(1 + _ROUNDS):
        u = _SIZE * random.standard_normal(ply.basis.N)
        for name, code in codes.items():
            times[name].append([_seconds(part, u) for part in code])
    parts = {
        name: [*zip(*rounds[1:], strict=True)]  # the first round is for warm-up
        for name, rounds in times.items()
    }
    return {
        "elements": int(mesh.nelements),
        "unknowns": int(ply.basis.N),
        "codes": {
            name: {
                "residual": spread(residual),
                "tangent": spread(tangent),
                "residual_over_ply": _ratio(residual, parts[_PLY][0]),
                "tangent_over_ply": _ratio(tangent, parts[_PLY][1]),
            }
            for name, (residual, tangent) in parts.items()
        },
    }


def _fabric() -> Fabric:
    return Fabric(_E, _G, (1, 1), (-1, 1))


def _each(mesh: MeshQuad) -> list[_Basis]:
    fabric, centre = _fabric(), quad_basis(mesh, CENTRE)
    corners = hourglass(fabric, _C_S), HourglassBasis(mesh)
    return [(tension(fabric), centre), (shear(fabric), centre), corners]


def _sums(mesh: MeshQuad) -> list[_Basis]:
    (first, centre), (second, _), corners = _each(mesh)
    return [(first + second, centre), corners]


def _by_forms(forms: Sequence[_Basis]) -> _Code:
    """Residual and tangent, summed over the bases."""

    def total(part: str, u: np.ndarray) -> Any:
        first, *others = (asm(getattr(x, part), basis, u=u) for x, basis in forms)
        return sum(others, first)

    return lambda u: total("residual", u), lambda u: total("tangent", u)


def _seconds(function: Callable[[np.ndarray], Any], u: np.ndarray) -> float:
    start = process_time()
    function(u)
    return process_time() - start


def _ratio(times: Sequence[float], of_ply: Sequence[float]) -> float:
    """Median of the ratios of the rounds."""
    return median(a / b for a, b in zip(times, of_ply, strict=True))


def plain_forms_table(results: Row) -> str:
    """A line for each code."""
    rows = [{"name": name, **row} for name, row in results["codes"].items()]
    times = {
        f"{part}, ms": lambda row, part=part: f"{1e3 * row[part]['median']:.0f}"
        for part in ("residual", "tangent")
    }
    ratios = {
        f"{part} ÷ ply": f"{{{part}_over_ply:.2f}}" for part in ("residual", "tangent")
    }
    return table(rows, {"": "{name}", **times, **ratios})


def in_words(results: Row) -> dict[str, str]:
    """Time ratios to a ply."""
    names = {_EACH: "each_form", _SUMS: "sum_of_forms"}
    return {
        f"{key}_{part}": f"{results['codes'][name][f'{part}_over_ply']:.1f}"
        for name, key in names.items()
        for part in ("residual", "tangent")
    }
