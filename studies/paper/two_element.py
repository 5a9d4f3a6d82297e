"""Locking of quadrilaterals: the two elements of Hamila & Boisse (2013), §2.3.

Element A = 1-2-3-4 lies below element B = 4-3-6-5.  Nodes 1 and 2 are clamped; fibres
are along x and y.  Inextensibility at a point is one linear equation in the nodal
velocities.  The paper writes these equations at 2×2 points and at the centre, and
determines the velocities that they leave free.  Coefficients are given as 4 ∂N/∂x.
This module compares the paper's equations with computed ones.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from skfem import Basis, ElementQuad1, MeshQuad

from skfem_textile.mesh.bases import CENTRE, GAUSS

from ..common.tables import Row, markdown_table

# Nodes 1 to 6.  The first mesh reproduces the paper's coefficients; the paper (Fig. 8)
# gives no coordinates for the others, which are chosen here.
MESHES = {
    "unaligned": [(0, 0), (2, 0), (2, 1.2), (0, 0.8), (0, 2), (2, 2)],
    "aligned": [(0, 0), (2, 0), (2, 1), (0, 1), (0, 2), (2, 2)],
    "horizontally aligned": [(0, 0), (2, 0), (2.4, 1), (-0.3, 1), (0, 2), (2, 2)],
}
_A, _B = (0, 1, 2, 3), (3, 2, 5, 4)

# The paper numbers Gauss points anticlockwise, scikit-fem along η first.
_ANTICLOCKWISE = [0, 2, 3, 1]
POINTS = {"2x2": (GAUSS[0][:, _ANTICLOCKWISE], GAUSS[1]), "one point": CENTRE}


class Printed(NamedTuple):
    """A system as printed in the paper: equation numbers, rows and conclusion."""

    equations: tuple[str, ...]
    rows: list[tuple[float, float, float]]
    conclusion: str


_SHORT, _LONG = (0.38225928, 1.42661107, 0), (1.13125423, 0.30311866, 0)
PRINTED = {
    ("unaligned", "2x2", "A", "x"): Printed(
        ("(4.1)", "(4.2)", "(4.3)", "(4.4)"),
        [
            (0.38225928, -0.57338893, 0),
            (0.30311866, -0.45467799, 0),
            (1.13125423, -1.69688134, 0),
            (1.42661107, -2.13991661, 0),
        ],
        "dependent: u3 = 1.5 u4",
    ),
    ("unaligned", "2x2", "A", "y"): Printed(
        ("(5.1)", "(5.2)", "(5.3)", "(5.4)"),
        [_SHORT, _LONG, _LONG, _SHORT],
        "v3 = v4 = 0",
    ),
    ("unaligned", "2x2", "B", "x"): Printed(
        ("(7.1)", "(7.2)", "(7.3)", "(7.4)"),
        [
            (-0.86874577, 0.30311866, -0.94271186),
            (-0.57338893, -0.13991661, -1.18884256),
            (-1.61774072, 1.42661107, -0.3185494),
            (-1.69688134, 1.54532201, -0.25259888),
        ],
        "rank 2: w5 = w6 = 1.66667",
    ),
    ("unaligned", "2x2", "B", "y"): Printed(("(6.2)",) * 4, [], "v5 = v6 = 0"),
    ("unaligned", "one point", "A", "x"): Printed(
        ("§2.3.5",), [(0.8, -1.2, 0)], "rank 1"
    ),
    ("unaligned", "one point", "A", "y"): Printed(("(8)",), [], "rank 1: v3 = -v4"),
    ("unaligned", "one point", "B", "x"): Printed(
        ("§2.3.5",), [(-1.2, 0.8, -2 / 3)], "u6 is arbitrary"
    ),
    ("unaligned", "one point", "B", "y"): Printed(
        ("§2.3.5",), [(0.8, 0.8, 1.6)], "rank 1"
    ),
    ("aligned", "2x2", "A", "x"): Printed(("§2.3.3",) * 4, [], "u3 = u4"),
    ("aligned", "2x2", "A", "y"): Printed(("§2.3.3",) * 4, [], "v3 = v4 = 0"),
    ("aligned", "2x2", "B", "x"): Printed(("§2.3.3",) * 4, [], "u5 = u6"),
    ("horizontally aligned", "2x2", "B", "x"): Printed(("§2.3.4",) * 4, [], "u5 = u6"),
}
_NOT_PRINTED = Printed(("-",) * 4, [], "-")


class PrintedSystem(NamedTuple):
    """The inextensibility equations of one fibre family in one element.

    Attributes
    ----------
    mesh, points, element, direction
        Key of `MESHES`, key of `POINTS`, ``A`` or ``B``, and ``x`` or ``y``.
    unknowns
        Names of the unknowns: velocities u (along x) or v (along y) of nodes 3 and 4 in
        element A; velocities of nodes 5 and 6 in element B, as w and z in units of u₃
        or v₃ if element A leaves these free.
    rows
        Coefficients of both unknowns and the right-hand side, one row per point.
    rank
        Rank of the coefficients.
    solution
        The two unknowns; None if one of them is undetermined.
    equations, printed, conclusion
        From `Printed`: the paper's equation numbers, rows, and statement on rank and
        solution.
    """

    mesh: str
    points: str
    element: str
    direction: str
    unknowns: tuple[str, str]
    rows: ndarray
    rank: int
    solution: ndarray | None
    equations: tuple[str, ...]
    printed: ndarray
    conclusion: str

    @property
    def factor(self) -> float:
        """Ratio of the printed to the computed coefficients."""
        if self.printed.size == 0:
            return np.nan
        computed, printed = self.rows[:, :2].ravel(), self.printed[:, :2].ravel()
        return float(round(computed @ printed / (computed @ computed), 6))

    @property
    def difference(self) -> ndarray:
        """Printed rows minus the computed rows times this factor."""
        known = self.printed.size
        return self.printed - self.factor * self.rows if known else self.printed


def systems() -> list[PrintedSystem]:
    """All systems of §2.3: meshes, points, elements and directions."""
    return [
        system
        for mesh in MESHES
        for points in POINTS
        for direction in "xy"
        for system in _both_elements(mesh, points, direction)
    ]


def _both_elements(mesh: str, points: str, direction: str) -> list[PrintedSystem]:
    """Element A, and element B given the free velocities of element A."""
    a, b = _coefficients(mesh, points)[:, "xy".index(direction)]
    velocity, ratio = {"x": ("u", "w"), "y": ("v", "z")}[direction]

    def system(element: str, symbol: str, matrix: ndarray, right: ndarray) -> Any:
        rank = int(np.linalg.matrix_rank(matrix, tol=1e-9))
        key = mesh, points, element, direction
        printed = PRINTED.get(key, _NOT_PRINTED)
        one, two = (3, 4) if element == "A" else (5, 6)
        return PrintedSystem(
            *key,
            (f"{symbol}{one}", f"{symbol}{two}"),
            np.column_stack([matrix, right]),
            rank,
            np.linalg.lstsq(matrix, right)[0] if rank == 2 else None,
            printed.equations,
            np.array(printed.rows),
            printed.conclusion,
        )

    node3, node4, node5, node6 = 2, 3, 3, 2  # local node numbers
    below = system("A", velocity, a[:, [node3, node4]], np.zeros(len(a)))
    right = np.zeros(len(b))
    if below.solution is None:  # nodes 3 and 4 are not fixed
        velocity, of_node3, of_node4 = ratio, 1.0, -below.rows[0, 0] / below.rows[0, 1]
        right = -(b[:, 1] * of_node3 + b[:, 0] * of_node4)
    return [below, system("B", velocity, b[:, [node5, node6]], right)]


def _coefficients(mesh: str, points: str) -> ndarray:
    """4 ∂N/∂x, shape (2 elements, 2 directions, points, 4 nodes)."""
    nodes = np.array(MESHES[mesh], dtype=float).T
    quads = MeshQuad(nodes, np.array([_A, _B]).T)
    basis = Basis(quads, ElementQuad1(), quadrature=POINTS[points])
    return 4 * np.array([basis.basis[i][0].grad for i in range(4)]).transpose(
        2, 1, 3, 0
    )


class Slip(NamedTuple):
    """A printed statement of the paper that contradicts the rest of it."""

    where: str
    printed: str
    correct: str
    evidence: str


def slips() -> list[Slip]:
    """The paper's slips, each with computed evidence."""
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
            "opposite signs of ξ_i and η_i",
            f"N_i at its node (ξ_i, η_i) = (1, 1) is {_eq1(1, 1, 1, 1):g}, "
            f"at the opposite node {_eq1(1, 1, -1, -1):g}",
        ),
        Slip(
            "Eqs. (5.1) to (5.4)",
            "0.38225928 v3 + 1.42661107 v4 = 0, ...",
            "4 ∂N/∂y",
            f"printed values are {vertical.factor:g} times 4 ∂N/∂y",
        ),
        Slip(
            "§2.3.5, last equation, left",
            "0.8 z5 + 0.8 z6",
            "4 ∂N/∂y",
            f"printed values are {last.factor:g} times 4 ∂N/∂y",
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
    """Systems and slips as JSON-serialisable data."""
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
    """Printed equations, systems and slips as Markdown tables.

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
    a, b, right = (round(x, 8) + 0.0 for x in row)  # avoids −0
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
