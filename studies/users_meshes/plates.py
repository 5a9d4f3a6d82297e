"""Plates with holes, regions and curved fibres on unstructured meshes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from skfem import Mesh, MeshQuad

from skfem_textile import Fabric, LoadStepper, Ply, StepError, split
from skfem_textile.fabric.directions import directions_of
from skfem_textile.mesh.scikit_fem import with_names
from skfem_textile.mesh.splitting import corner_areas, split_cells
from skfem_textile.outlines import Outline, fitted, singular_fibres
from skfem_textile.outlines.meshing import irregular
from skfem_textile.solve.interval import work_of

from ..singular_fibres.cases import LAWS, WIDTH, G, box, circle
from ..singular_fibres.irregular import (
    DEFAULT,
    FINE,
    HEIGHT,
    Curved,
    arcs,
    steered,
    straight,
)
from ..study import Row

# Least area at a corner of a quadrilateral of two triangles, relative to the largest.
_CONVEX = 0.3

#: Kinds of plates and meshes.
SHAPES = "plain", "hole", "notch", "patch", "arcs", "steered"
KINDS = "triangles", "quadrilaterals", "both"


@dataclass(frozen=True)
class OnFile:
    """A plate on an unstructured mesh, such as one of a file.

    Attributes
    ----------
    case
        Name.
    plate
        The plate.
    kind
        ``triangles``, ``quadrilaterals`` or ``both``.
    seed
        Seed of the mesh.
    """

    case: str
    plate: Curved
    kind: str
    seed: int

    def __str__(self) -> str:
        return self.case

    def rows(self) -> list[Row]:
        """Error and interval of the load on the fitted mesh."""
        plate, mesh = self.plate, _mesh(self.plate, self.kind, self.seed)
        coarse, load = (plate.converged(across) for across in FINE)
        fabric: Any = _per_element(plate.fabric, mesh)
        if plate.fabrics:
            own = {"rest": fabric, **plate.fabrics}
            fabric = {name: own[name] for name in mesh.subdomains or {}}
        conditions = plate.conditions()
        fit = fitted(mesh, fabric, conditions)
        ply = Ply(fit.mesh, fit.fabric, fit.formulation)
        row: Row = {"kind": self.kind, "note": fit.note, "unknowns": int(ply.basis.N)}
        row |= {"reference": load, "spread": coarse / load - 1}
        stepper = LoadStepper(ply, conditions, steps=4)
        try:
            result = stepper.run()
        except StepError as refusal:
            return [{**row, "refused": str(refusal)}]
        found = work_of(stepper.problem.at(1.0), result.states[-1]) / plate.travel
        error = result.error
        return [
            {
                **row,
                "error": found / load - 1,
                "half_width": error.load,
                "reason": error.reason,
                "refused": "",
            }
        ]


def _per_element(fabric: Fabric, mesh: Mesh) -> Fabric:
    """Fabric with curved fibres as a file gives them, a direction in each element."""
    if any(callable(family.direction) for family in fabric.families):
        return directions_of(mesh, fabric).on(fabric)
    return fabric


def _mesh(plate: Curved, kind: str, seed: int) -> Mesh:
    """Mesh of the outline and the regions, without edges on singular fibres."""
    outline, random = plate.outline, np.random.default_rng(seed)
    size = float(np.sqrt(outline.shape().area)) / DEFAULT
    lines = singular_fibres(outline, Fabric(), fabrics=plate.fabrics)
    lines = replace(lines, fibres=[], weak=[], held=[])
    turn = random.uniform(0, np.pi / 3)
    # Three quadrilaterals of each triangle, or pairs of triangles, are of this size.
    factor = {"triangles": 1.0, "both": 1.0, "quadrilaterals": 1.7}[kind]
    triangles: Any = irregular(outline, lines, factor * size, turn)
    if kind == "triangles":
        return triangles
    if kind == "both":
        return _paired(triangles, random)
    parts = split(triangles)
    return with_names(MeshQuad(parts.p, parts.t), parts.boundaries, parts.subdomains)


def _paired(mesh: Any, random: Any) -> Mesh:
    """Cells of both kinds: pairs of triangles become quadrilaterals where convex."""
    region = np.zeros(mesh.nelements, dtype=int)
    for i, elements in enumerate((mesh.subdomains or {}).values()):
        region[elements] = i
    free, quads, of_pair = np.ones(mesh.nelements, dtype=bool), [], []
    for edge in random.permutation(np.flatnonzero(mesh.f2t[1] >= 0)):
        a, b = mesh.f2t[:, edge]
        if not (free[a] and free[b] and region[a] == region[b]):
            continue
        ends = mesh.facets[:, edge]
        first, second = (np.setdiff1d(mesh.t[:, k], ends)[0] for k in (a, b))
        quad = np.array([[ends[0]], [first], [ends[1]], [second]])
        corners = corner_areas(MeshQuad(mesh.p, quad))
        if corners.min() > _CONVEX * corners.max():
            free[[a, b]] = False
            quads.append(quad)
            of_pair.append(region[a])
    cells = mesh.t[:, free], np.hstack(quads)
    of_cell = np.append(region[free], of_pair)
    return split_cells(
        mesh.p,
        cells,
        {name: mesh.facets[:, at] for name, at in (mesh.boundaries or {}).items()},
        {n: np.flatnonzero(of_cell == i) for i, n in enumerate(mesh.subdomains or {})},
    )


def _plate(shape: str, random: Any) -> Curved:
    """Plate of a shape."""
    degrees, E = random.uniform(38, 54), G * 10 ** random.uniform(4, 5.5)
    law = LAWS[str(random.choice(["linear", "sin²", "locking"]))]
    fabric = Fabric(E, law, *straight(degrees))
    polygon: Any = box(HEIGHT)
    holes: Any = ()
    more: Any = {}
    fabrics: Any = {}
    travel = random.uniform(4, 10)
    x, y = random.uniform(18, 32), random.uniform(45, 70)
    match shape:
        case "hole":
            holes = (circle(x, y, random.uniform(5, 10)),)
        case "notch":
            notch = (WIDTH, y - 5), (WIDTH - random.uniform(6, 12), y), (WIDTH, y + 5)
            polygon = *box(HEIGHT)[:2], *notch, *box(HEIGHT)[2:]
        case "patch":
            a, b = random.uniform(8, 12), random.uniform(12, 20)
            corners = [[x - a, x + a, x + a, x - a], [y - b, y - b, y + b, y + b]]
            more = {"regions": {"patch": corners}}
            other = straight(degrees + random.uniform(-4, 4))
            fabrics = {"patch": Fabric(E, 2 * G, *other)}
        case "arcs":
            # No fibre connects the clamps.
            low, more_far = random.uniform(60, 120), random.uniform(20, 45)
            far = low + more_far
            fabric = Fabric(E, law, *arcs(-far, -low))
        case "steered":
            warp = steered(degrees, degrees + random.uniform(5, 12))
            fabric = Fabric(E, law, warp, straight(180 - degrees)[0])
    outline = Outline(np.transpose(polygon), [np.transpose(h) for h in holes], **more)
    return Curved(shape, outline, fabric, travel, fabrics)


def on_files(seed: int, before: str, n: int = 60) -> Iterator[OnFile]:
    """Plates on triangles, quadrilaterals and both."""
    random = np.random.default_rng(seed)
    for i in range(n):
        shape = SHAPES[i % len(SHAPES)]
        kind = KINDS[(i + i // len(SHAPES)) % len(KINDS)]  # each shape has all kinds
        name = f"{before}{shape} {i + 1}, {kind}"
        yield OnFile(name, _plate(shape, random), kind, i)
