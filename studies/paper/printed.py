"""The two-element systems of Hamila & Boisse (2013) beside what the paper prints."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..common.tables import markdown_table
from ..study import Row
from .two_element import MESHES, systems


class Slip(NamedTuple):
    """Something that the paper prints and that does not follow from the rest of it."""

    where: str
    printed: str
    correct: str
    evidence: str


def slips() -> list[Slip]:
    """The paper's slips, each with numbers computed here that show it."""
    by_name = {s[:4]: s for s in systems()}
    vertical = by_name["unaligned", "2x2", "A", "y"]
    last = by_name["unaligned", "one point", "B", "y"]
    return [
        Slip(
            "§2.2",
            "the shear angle reaches 60°",
            "60/55 rad",
            f"{np.degrees(60 / 55):.2f}°",
        ),
        Slip(
            "§3.3",
            "5.39e-4 is twenty times less than 9.5e-3",
            "their ratio",
            f"{9.5e-3 / 5.39e-4:.1f} times",
        ),
        Slip(
            "Eq. (1)",
            "N_i = (1 - ξ_i ξ)(1 - η_i η)/4",
            "ξ_i and η_i of the opposite sign",
            f"N_i at its node (ξ_i, η_i) = (1, 1) is {_eq1(1, 1, 1, 1):g}, "
            f"at the opposite one {_eq1(1, 1, -1, -1):g}",
        ),
        Slip(
            "Eqs. (5.1) to (5.4)",
            "0.38225928 v3 + 1.42661107 v4 = 0, ...",
            "4 ∂N/∂y",
            f"printed are {vertical.factor:g} times these",
        ),
        Slip(
            "§2.3.5, last equation, left",
            "0.8 z5 + 0.8 z6",
            "4 ∂N/∂y",
            f"printed are {last.factor:g} times these",
        ),
        Slip(
            "§2.3.5, last equation, right",
            "1.6",
            "0, with v4 = -v3 from Eq. (8)",
            f"{last.rows[0, 2] + 0.0:g}",
        ),
        Slip(
            "§2.3.2, g_1 of element B",
            "x5 - x6",
            "x6 - x5",
            f"at the centre det(g_1, g_2) is {_jacobian_of_B(5, 6):g} as printed, "
            f"{_jacobian_of_B(6, 5):g} as corrected; a quarter of its area of 2 is 0.5",
        ),
        Slip(
            "§3.2, rate of M̃_s",
            "f^T B_HGL^T [u v]",
            "f^T B_HGL [u v]",
            f"f has {_F.shape[0]} entries, B_HGL^T {_B_HGL.T.shape[0]} rows, "
            f"B_HGL {_B_HGL.shape[0]}",
        ),
    ]


_F, _B_HGL = np.empty(4), np.empty((4, 8))  # shapes as defined in §3.1 and §3.2


def _eq1(xi_i: float, eta_i: float, xi: float, eta: float) -> float:
    """Eq. (1) as printed."""
    return 0.25 * (1 - xi_i * xi) * (1 - eta_i * eta)


def _jacobian_of_B(first: int, second: int) -> float:
    """det(g_1, g_2) at the centre of element B, with x_first - x_second in g_1."""
    x = dict(enumerate(np.array(MESHES["unaligned"]), start=1))
    g1 = 0.25 * ((x[3] - x[4]) + (x[first] - x[second]))
    g2 = 0.25 * ((x[5] - x[4]) + (x[6] - x[3]))
    return float(np.linalg.det(np.array([g1, g2])))


def report() -> Row:
    """Systems and slips as plain data, ready for JSON."""
    return {
        "systems": [
            {
                **system._asdict(),
                "unknowns": list(system.unknowns),
                "rows": system.rows.tolist(),
                "solution": None
                if system.solution is None
                else system.solution.tolist(),
                "equations": list(system.equations),
                "printed": system.printed.tolist(),
                "factor": None if np.isnan(system.factor) else system.factor,
                "difference": system.difference.tolist(),
            }
            for system in systems()
        ],
        "slips": [slip._asdict() for slip in slips()],
    }


def table(systems: Sequence[Row], slips: Sequence[Row]) -> str:
    """Equations that the paper prints, systems and slips as Markdown tables.

    Parameters
    ----------
    systems, slips
        As from `report`.
    """
    equations, solutions = [], []
    for s in systems:
        which = f"{s['mesh']}, {s['points']}, {s['element']} along {s['direction']}"
        solutions.append([which, s["rank"], _solution(s), s["conclusion"]])
        compared = zip(
            s["equations"], s["rows"], s["printed"], s["difference"], strict=False
        )
        for number, row, printed, difference in compared:
            off = f"{np.abs(difference).max():.1e}"
            off += f", after a factor {s['factor']:g}" if s["factor"] != 1 else ""
            line = _equation(s, printed), _equation(s, row), off
            equations.append([which, number, *line])
    tables: dict[tuple[str, ...], Any] = {
        ("system", "paper", "printed", "computed", "difference"): equations,
        ("system", "rank", "solution", "paper's conclusion"): solutions,
        ("where", "printed", "correct", "computed"): [s.values() for s in slips],
    }
    return "\n".join(markdown_table(list(head), x) for head, x in tables.items())


def _equation(system: Row, row: Sequence[float]) -> str:
    a, b, right = (round(x, 8) + 0.0 for x in row)  # no minus zero
    first, second = system["unknowns"]
    sign = "+" if b >= 0 else "-"
    left = f"{a:.10g} {first} {sign} {abs(b):.10g} {second}"
    return f"{left} = {right:.10g}"


def _solution(system: Row) -> str:
    first, second = system["unknowns"]
    if system["solution"] is None:
        a, b, right = system["rows"][0]
        constant = f"{right / b:.6g} + " if right else ""
        return f"{second} = {constant}{-a / b:.6g} {first}"
    x, y = (value + 0.0 for value in system["solution"])
    return f"{first} = {x:.6g}, {second} = {y:.6g}"
