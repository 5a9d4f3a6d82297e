"""The two-element systems of Hamila & Boisse (2013) beside what the paper prints."""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..scenes.two_element import MESHES, System, systems


class Slip(NamedTuple):
    """Something that the paper prints and that does not follow from the rest of it."""

    where: str
    printed: str
    correct: str
    computed: float
    expected: float


def slips() -> list[Slip]:
    """The paper's slips, each with a number computed here and what it should be."""
    by = {s[:4]: s for s in systems()}
    vertical = by["unaligned", "2x2", "A", "y"]
    last = by["unaligned", "one point", "B", "y"]
    x = dict(enumerate(np.array(MESHES["unaligned"]), start=1))
    g1 = [0.25 * ((x[3] - x[4]) + pair) for pair in (x[5] - x[6], x[6] - x[5])]
    return [
        Slip(
            "§2.2",
            "the shear angle reaches 60°",
            "60/55 rad, in degrees",
            float(np.degrees(60 / 55)),
            62.5,
        ),
        Slip(
            "§3.3",
            "5.39e-4 is twenty times less than 9.5e-3",
            "their ratio",
            9.5e-3 / 5.39e-4,
            17.625,
        ),
        Slip(
            "Eq. (1)",
            "N_i = (1 - ξ_i ξ)(1 - η_i η)/4",
            "plus signs, or ξ_i, η_i of the opposite sign: N_i at its node",
            0.25 * (1 - 1 * 1) * (1 - 1 * 1),
            0.0,
        ),
        Slip(
            "Eqs. (5.1)-(5.4)",
            "0.38225928 v3 + 1.42661107 v4 = 0, ...",
            "the coefficients are those of 4 ∂N/∂y times",
            vertical.factor,
            0.4,
        ),
        Slip(
            "§2.3.5, last equation, left",
            "0.8 z5 + 0.8 z6",
            "the coefficients are those of 4 ∂N/∂y times",
            last.factor,
            0.4,
        ),
        Slip(
            "§2.3.5, last equation, right",
            "1.6",
            "with v4 = -v3 from Eq. (8)",
            float(last.rows[0, 2]) + 0.0,
            0.0,
        ),
        Slip(
            "§2.3.2, g_1 of element B",
            "x5 - x6",
            "x6 - x5: |g_1| at the centre, printed; with x6 - x5 it is 1.005",
            float(np.linalg.norm(g1[0])),
            0.1,
        ),
        Slip(
            "§3.2, rate of M̃_s",
            "f^T B_HGL^T [u v]",
            "f^T B_HGL [u v]: columns of B_HGL^T, against 8 velocities",
            4.0,
            4.0,
        ),
    ]


def report() -> dict[str, list[dict]]:
    """Systems and slips as plain data, ready for JSON."""
    return {
        "systems": [
            {
                **system._asdict(),
                "rows": system.rows.tolist(),
                "solution": None
                if system.solution is None
                else system.solution.tolist(),
                "printed": system.printed.tolist(),
                "factor": None if np.isnan(system.factor) else system.factor,
                "difference": system.difference.tolist(),
            }
            for system in systems()
        ],
        "slips": [slip._asdict() for slip in slips()],
    }


def table() -> str:
    """Systems and slips as Markdown tables."""
    lines = [
        "| mesh | points | element | along | equation | printed | computed | difference"
        " | rank | solution |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for s in systems():
        found = _solution(s)
        for i, row in enumerate(s.rows):
            printed = _equation(s, s.printed[i]) if s.printed.size else "-"
            off = f"{np.abs(s.difference[i]).max():.1e}" if s.printed.size else "-"
            if s.printed.size and s.factor != 1:
                off += f", after a factor {s.factor:g}"
            lines.append(
                f"| {s.mesh} | {s.points} | {s.element} | {s.direction} | {i + 1} "
                f"| {printed} | {_equation(s, row)} | {off} | {s.rank} | {found} |"
            )
    lines += ["", "| where | printed | correct | computed |", "|---|---|---|---|"]
    lines += [
        f"| {s.where} | {s.printed} | {s.correct} | {s.computed:.6g} |" for s in slips()
    ]
    return "\n".join(lines) + "\n"


def _equation(system: System, row: ndarray) -> str:
    a, b, right = (x + 0.0 for x in row.round(8))  # no minus zero
    first, second = system.unknowns
    return (
        f"{a:.8g} {first} {'+' if b >= 0 else '-'} {abs(b):.8g} {second} = {right:.8g}"
    )


def _solution(system: System) -> str:
    first, second = system.unknowns
    if system.solution is None:
        a, b, right = system.rows[0]
        constant = f"{right / b:.6g} + " if right else ""
        return f"{second} = {constant}{-a / b:.6g} {first}"
    x, y = system.solution + 0.0
    return f"{first} = {x:.6g}, {second} = {y:.6g}"
