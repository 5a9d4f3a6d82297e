"""Plies on irregular triangles: curved fibres, several fabrics, and specimens."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import Mesh

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Macro,
    Outline,
    Ply,
    Quadratic,
    along_edges,
    mesh_outline,
    singular_fibres,
)
from skfem_textile.fabric import kinematics
from skfem_textile.outlines.meshing import FINEST, SINGULAR, irregular

from ..study import Row
from . import cases
from .cases import LAWS, WIDTH, Case, G, box, circle, specimens
from .refinement import refined

# Seed of the specimens.
_SEED = 20261

#: Elements across √area: of the default size, and of the reference meshes, whose
#: elements at singular fibres are refined twice.
DEFAULT, FINE = 16, (16, 22)

#: Formulations in the order of the table.
FORMULATIONS = Quadratic(400.0, points=6), Macro(), Quadratic()

#: Height of the plies in mm.
HEIGHT = 115.0


@dataclass(frozen=True)
class Irregular:
    """A specimen on irregular triangles with the singular fibres as edges.

    Attributes
    ----------
    case
        Name.
    specimen
        The specimen.
    across
        Elements across the width.
    turn
        Direction of the rows of nodes in radians.
    """

    case: str
    specimen: Case
    across: int
    turn: float

    def __str__(self) -> str:
        return self.case

    def rows(self) -> list[Row]:
        """Errors of the load and of the shear angle for each formulation."""
        outline, fabric, conditions = self.specimen.problem()
        net = mesh_outline(outline, fabric, conditions, density=cases.FINE)
        exact = Ply(net, fabric, FORMULATIONS[0])
        last = LoadStepper(exact, conditions, steps=1).run().states[-1]
        reference = float(last.reactions["top"][1])
        size = WIDTH / self.across
        fibres = singular_fibres(outline, fabric, conditions, finest=FINEST * size)
        mesh = irregular(outline, fibres, size, self.turn)
        rows = []
        for formulation in FORMULATIONS:
            ply = Ply(mesh, fabric, formulation)
            state = LoadStepper(ply, conditions, steps=1).run().states[-1]
            load = float(state.reactions["top"][1])
            rows.append(
                {
                    "case": self.case,
                    "formulation": formulation.title,
                    "across": self.across,
                    "unknowns": int(ply.basis.N),
                    "load": load,
                    "error": load / reference - 1,
                    "angle_error": angle_error(ply, state.u, exact, last.u),
                }
            )
        return rows


def angle_error(ply: Ply, u: ndarray, exact: Ply, u_exact: ndarray) -> float:
    """Area-weighted rms difference of the shear angles of two plies, in degrees.

    They are compared at the integration points of the first.
    """
    x = np.asarray(ply.basis.global_coordinates())
    weights = ply.basis.dx
    points = x.reshape(2, -1)
    # Points on the outline may be outside by round-off.
    points += 1e-9 * (points.mean(axis=1, keepdims=True) - points)
    basis = exact.basis
    element = basis.mesh.element_finder()(*points)
    local = basis.mapping.invF(points[:, :, None], tind=element)
    F = np.tile(np.eye(2)[:, :, None, None], (1, 1, len(element), 1))
    for i in range(basis.Nbfun):
        (shape,) = basis.elem.gbasis(basis.mapping, local, i, tind=element)
        F += u_exact[basis.element_dofs[i, element]][:, None] * shape.grad
    A = exact.fabric.directions(points[:, :, None], element[:, None])
    expected = kinematics.shear_angle(F, *A).reshape(weights.shape)
    square = np.sum(weights * (ply.shear_angle(u) - expected) ** 2) / weights.sum()
    return float(np.degrees(np.sqrt(square)))


def irregular_triangles() -> Iterator[Irregular]:
    """Specimens other than those on nets, each on three meshes of two sizes."""
    for i, drawn in enumerate(specimens(_SEED, 12), start=1):
        for across, turn in product((16, 32), (0.0, 0.35, 0.7)):
            name = f"triangles {i}, {across} across, turned by {turn:g}"
            yield Irregular(name, drawn, across, turn)


@dataclass(frozen=True)
class Curved:
    """A ply with curved fibres or several fabrics, pulled at its top edge.

    Attributes
    ----------
    case
        Name.
    outline, fabric, fabrics
        The outline, its fabric, and the fabrics of its regions.
    travel
        Displacement of the top in mm.
    along
        Direction of the displacement.
    finest
        Least distances of reflections relative to the size of triangles.
    """

    case: str
    outline: Outline
    fabric: Fabric
    travel: float
    fabrics: Mapping[str, Fabric] = field(default_factory=dict)
    along: tuple[float, float] = (0.0, 1.0)
    finest: tuple[float, ...] = (FINEST,)

    def __str__(self) -> str:
        return self.case

    def rows(self) -> list[Row]:
        """Error of the load for each formulation, and without `along_edges`."""
        coarse, reference = (self.converged(across) for across in FINE)
        rows = []
        for finest in self.finest:
            mesh = self._mesh(DEFAULT, finest)
            runs = [(formulation, True) for formulation in FORMULATIONS]
            for formulation, mapped in [*runs, (FORMULATIONS[0], False)]:
                load, unknowns = self._load(mesh, formulation, mapped)
                rows.append(
                    {
                        "case": self.case,
                        "formulation": formulation.title,
                        "along_edges": mapped,
                        "finest": finest,
                        "unknowns": unknowns,
                        "load": load,
                        "reference": reference,
                        "error": load / reference - 1,
                        "last_change": coarse / reference - 1,
                    }
                )
        return rows

    def conditions(self) -> dict[str, Condition]:
        """Clamps at the bottom and at the top."""
        x, y = self.along
        pull = self.travel * x, self.travel * y
        return {"bottom": Condition("bottom"), "top": Condition("top", pull)}

    def _mesh(self, across: int, finest: float = FINEST) -> Mesh:
        size = float(np.sqrt(self.outline.shape().area)) / across
        lines = singular_fibres(
            *(self.outline, self.fabric, self.conditions()),
            fabrics=self.fabrics,
            finest=finest * size,
        )
        return irregular(self.outline, lines, size)

    def converged(self, across: int, times: int = 2, steps: int = 1) -> float:
        """Load in N on a mesh refined at the singular fibres, by default twice."""
        mesh: Any = self._mesh(across)
        for _ in range(times):
            beside = np.unique(mesh.f2t[:, mesh.boundaries[SINGULAR]])
            mesh = refined(mesh, beside[beside >= 0])
        return self._load(mesh, FORMULATIONS[0], True, steps)[0]

    def _load(
        self, mesh: Any, formulation: Any, mapped: bool, steps: int = 1
    ) -> tuple[float, int]:
        """Load in N, and unknowns."""
        fabrics = {"rest": self.fabric, **self.fabrics}
        if mapped:
            fabrics = {name: along_edges(mesh, of) for name, of in fabrics.items()}
        used = {name: fabrics[name] for name in mesh.subdomains or {}}
        ply = Ply(mesh, used or fabrics["rest"], formulation)
        state = LoadStepper(ply, self.conditions(), steps=steps).run().states[-1]
        return float(state.reactions["top"][:2] @ self.along), int(ply.basis.N)


def straight(degrees: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Warp and weft at ± an angle to the clamps."""
    c, s = float(np.cos(np.radians(degrees))), float(np.sin(np.radians(degrees)))
    return (c, s), (-c, s)


def _fabric(degrees: float, E: float, shear: float) -> Fabric:
    return Fabric(E, shear, *straight(degrees))


def _spirals(degrees: float) -> tuple[Any, Any]:
    """Log spirals about the origin at ± an angle to the rays."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))

    def family(sign: int) -> Any:
        def direction(x: ndarray) -> ndarray:
            return sign * c * x + s * np.stack([-x[1], x[0]])

        return direction

    return family(1), family(-1)


def arcs(x0: float, y0: float) -> tuple[Any, Any]:
    """Rays from a point, and arcs about it."""
    return (
        lambda x: np.stack([x[0] - x0, x[1] - y0]),
        lambda x: np.stack([y0 - x[1], x[0] - x0]),
    )


def steered(low: float, high: float) -> Any:
    """An angle in degrees that increases from the bottom to the top."""

    def direction(x: ndarray) -> ndarray:
        angle = np.radians(low + (high - low) * x[1] / HEIGHT)
        return np.stack([np.cos(angle), np.sin(angle)])

    return direction


def _parabolas(degrees: float, curvature: float) -> Any:
    """Parabolas with a slope in the middle and a change of slope in 1/mm."""

    def direction(x: ndarray) -> ndarray:
        slope = np.tan(np.radians(degrees)) + curvature * (x[0] - WIDTH / 2)
        return np.stack([np.ones_like(slope), slope])

    return direction


def _sector(
    holes: tuple[Any, ...] = (),
) -> tuple[Outline, tuple[float, float]]:
    """A sector of a ring, and the direction away from its other clamp."""
    angle, inner, outer, n = 1.2, 83.0, 152.0, 40
    at = np.linspace(0, angle, n + 1)
    arc = np.array([np.cos(at), np.sin(at)])
    rings = np.hstack([outer * arc, inner * arc[:, ::-1]])
    names = {"top": [n], "bottom": [2 * n + 1]}
    outline = Outline(rings, [np.transpose(h) for h in holes], names)
    return outline, (float(-np.sin(angle)), float(np.cos(angle)))


def _rectangle(*holes: Any, **more: Any) -> Outline:
    return Outline(np.transpose(box(HEIGHT)), [np.transpose(h) for h in holes], **more)


def _part(x0: float, x1: float, y0: float, y1: float) -> list[list[float]]:
    return [[x0, x1, x1, x0], [y0, y0, y1, y1]]


def curved() -> Iterator[Curved]:
    """Five plies with curved fibres, and five with two fabrics."""
    E, sin2 = 1e5, LAWS["sin²"]
    sector, along = _sector()
    yield Curved(
        "curved: spirals", sector, Fabric(E, G, *_spirals(45)), 12.0, {}, along
    )
    sector, along = _sector((circle(97.4, 66.6, 9.0),))
    fabric = Fabric(E, G, *_spirals(48))
    yield Curved("curved: spirals, hole", sector, fabric, 7.0, {}, along)
    notch = (WIDTH, 50.0), (WIDTH - 8, 55.0), (WIDTH, 60.0)
    sides = (*box(HEIGHT)[:2], *notch, *box(HEIGHT)[2:])
    fabric = Fabric(5e4, sin2, *arcs(160, -50))
    outline = Outline(np.transpose(sides))
    yield Curved("curved: arcs and rays, notch", outline, fabric, 9.0)
    fabric = Fabric(E, G, steered(38, 54), straight(133)[0])
    outline = _rectangle(circle(22, 55, 10))
    yield Curved("curved: steered warp, hole", outline, fabric, 9.0)
    fabric = Fabric(E, G, _parabolas(45, 0.012), straight(132)[0])
    square = (18.0, 48.0), (32.0, 48.0), (32.0, 62.0), (18.0, 62.0)
    yield Curved("curved: parabolas, square hole", _rectangle(square), fabric, 9.0)
    outline = _rectangle(regions={"patch": _part(14, 36, 40, 74)})
    base = _fabric(45, E, G)
    for name, patch, travel in (
        ("stiff patch", _fabric(45, 2e5, 2.0), 10.0),
        ("turned patch", _fabric(62, E, G), 8.0),
    ):
        yield Curved(f"fabrics: {name}", outline, base, travel, {"patch": patch})
    outline = _rectangle(regions={"upper": _part(0, WIDTH, 60, HEIGHT)})
    upper = {"upper": _fabric(50, 3e5, 1.0)}
    yield Curved("fabrics: two halves", outline, _fabric(43, E, G), 9.0, upper)
    outline = _rectangle(regions={"right": _part(25, WIDTH, 0, HEIGHT)})
    right = {"right": _fabric(52, E, 1.0)}
    yield Curved("fabrics: side by side", outline, base, 8.0, right)
    regions = {"right": _part(30, WIDTH, 0, HEIGHT)}
    outline = _rectangle(circle(18, 55, 8), regions=regions)
    right = {"right": _fabric(45, E, 2.0)}
    yield Curved("fabrics: hole beside the border", outline, base, 8.0, right)


def chosen_finest() -> Iterator[Curved]:
    """Plies with which `FINEST` was chosen, other than those above."""
    finest = 0.25, 0.5, 1.0
    outline = _rectangle(regions={"patch": _part(10, 30, 45, 80)})
    patch = {"patch": _fabric(45, 1e5, 1.5)}
    base = _fabric(44, 2e5, G)
    yield Curved("finest: patch", outline, base, 7.0, patch, finest=finest)
    outline = _rectangle(regions={"right": _part(20, WIDTH, 0, HEIGHT)})
    right = {"right": _fabric(50, 1e5, 1.5)}
    yield Curved("finest: side by side", outline, base, 7.0, right, finest=finest)
    outline = _rectangle(circle(30, 60, 8))
    fabric = Fabric(1e5, G, *arcs(-120, -60))
    yield Curved("finest: arcs and rays, hole", outline, fabric, 7.0, finest=finest)
