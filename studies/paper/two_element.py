"""Why quadrilaterals lock: two elements of Hamila & Boisse (2013), §2.3.

Two elements, A = 1-2-3-4 and above it B = 4-3-6-5, clamped at nodes 1 and 2, fibres
along x and y.  That no fibre is stretched at a point is one linear equation in the
nodal velocities.  The paper writes these equations at 2×2 points and at the centre, and
asks which velocities they leave free.  Coefficients are printed as 4 ∂N/∂x.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray
from skfem import Basis, ElementQuad1, MeshQuad

from skfem_textile.mesh.bases import CENTRE, GAUSS

# Nodes 1 to 6.  The first mesh is that of the paper's coefficients; of the others the
# paper (Fig. 8) gives no coordinates: these are ours.
MESHES = {
    "unaligned": [(0, 0), (2, 0), (2, 1.2), (0, 0.8), (0, 2), (2, 2)],
    "aligned": [(0, 0), (2, 0), (2, 1), (0, 1), (0, 2), (2, 2)],
    "horizontally aligned": [(0, 0), (2, 0), (2.4, 1), (-0.3, 1), (0, 2), (2, 2)],
}
_A, _B = (0, 1, 2, 3), (3, 2, 5, 4)

# The paper numbers its Gauss points anticlockwise, scikit-fem along η first.
_ANTICLOCKWISE = [0, 2, 3, 1]
POINTS = {"2x2": (GAUSS[0][:, _ANTICLOCKWISE], GAUSS[1]), "one point": CENTRE}


class Printed(NamedTuple):
    """What the paper prints of a system: equations, rows, and what they leave."""

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
    """The equations of no stretch along one fibre family in one element.

    Attributes
    ----------
    mesh, points, element, direction
        A key of `MESHES`, one of `POINTS`, ``A`` or ``B``, and ``x`` or ``y``.
    unknowns
        Names of the unknowns: velocities u (along x) or v (along y) of nodes 3 and 4 in
        element A; velocities of nodes 5 and 6 in element B, as w and z in units of u₃
        or v₃ if element A leaves these free.
    rows
        Coefficients of both unknowns and the right side, one row per point.
    rank
        Rank of the coefficients.
    solution
        The two unknowns; None if the equations leave one of them free.
    equations
        The paper's numbers of the rows.
    printed
        The rows as the paper prints them; empty if it prints none.
    conclusion
        What the paper says about rank and solution.
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
        """The factor from the computed coefficients to the printed ones."""
        if self.printed.size == 0:
            return np.nan
        computed, printed = self.rows[:, :2].ravel(), self.printed[:, :2].ravel()
        return float(round(computed @ printed / (computed @ computed), 6))

    @property
    def difference(self) -> ndarray:
        """Printed rows minus the computed rows times this factor."""
        return (
            self.printed - self.factor * self.rows
            if self.printed.size
            else self.printed
        )


def systems() -> list[PrintedSystem]:
    """Every system of §2.3: meshes, points, elements and directions."""
    return [
        system
        for mesh in MESHES
        for points in POINTS
        for direction in "xy"
        for system in _both_elements(mesh, points, direction)
    ]


def _both_elements(mesh: str, points: str, direction: str) -> list[PrintedSystem]:
    """Element A, and element B given what element A leaves free."""
    case = mesh, points
    a, b = _coefficients(mesh, points)[:, "xy".index(direction)]
    velocity, ratio = {"x": ("u", "w"), "y": ("v", "z")}[direction]
    node3, node4, node5, node6 = 2, 3, 3, 2  # places in the elements' lists of nodes
    below = _system(
        *case, "A", direction, velocity, a[:, [node3, node4]], np.zeros(len(a))
    )
    if below.solution is not None:  # nodes 3 and 4 are held
        right = np.zeros(len(b))
    else:
        velocity, of_node3, of_node4 = ratio, 1.0, -below.rows[0, 0] / below.rows[0, 1]
        right = -(b[:, 1] * of_node3 + b[:, 0] * of_node4)
    above = _system(*case, "B", direction, velocity, b[:, [node5, node6]], right)
    return [below, above]


def _system(
    mesh: str,
    points: str,
    element: str,
    direction: str,
    symbol: str,
    matrix: ndarray,
    right: ndarray,
) -> PrintedSystem:
    rank = int(np.linalg.matrix_rank(matrix, tol=1e-9))
    solution = np.linalg.lstsq(matrix, right)[0] if rank == 2 else None
    nodes = (3, 4) if element == "A" else (5, 6)
    printed = PRINTED.get((mesh, points, element, direction), _NOT_PRINTED)
    return PrintedSystem(
        mesh,
        points,
        element,
        direction,
        (f"{symbol}{nodes[0]}", f"{symbol}{nodes[1]}"),
        np.column_stack([matrix, right]),
        rank,
        solution,
        printed.equations,
        np.array(printed.rows),
        printed.conclusion,
    )


def _coefficients(mesh: str, points: str) -> ndarray:
    """4 ∂N/∂x, shape (2 elements, 2 directions, points, 4 nodes)."""
    nodes = np.array(MESHES[mesh], dtype=float).T
    quads = MeshQuad(nodes, np.array([_A, _B]).T)
    basis = Basis(quads, ElementQuad1(), quadrature=POINTS[points])
    return 4 * np.array([basis.basis[i][0].grad for i in range(4)]).transpose(
        2, 1, 3, 0
    )
