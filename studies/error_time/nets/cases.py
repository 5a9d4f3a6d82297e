"""The bias extension on irregular meshes and on nets, for every code."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from time import perf_counter
from typing import Any

from skfem import Mesh

from skfem_textile import Outline, mesh_outline
from skfem_textile.mesh.splitting import split

from ...common.rivals.rival import QUAD4_CENTRE, TRIANGLE6
from ...common.tables import Row
from ...formulations.cases import Specimen
from ..cases import CODES, PROBLEMS, OtherCode, Timed
from ..fronts import SETS

#: Number of edges along a clamp, roughly, of a net of density 1.
EDGES = 8

#: Seeds of the irregular meshes; on nets, which have no seed, repetitions.
SEEDS = (1, 2, 3)

#: Edges across by kind of mesh, up to nets of density 1.5.
ACROSS = {"irregular": (8, 16, 32, 64, 96, 128), "net": (4, 6, 8, 12, 16, 24)}

#: Entry ``code`` of the rows of mesh generation.
MESHING = "mesh"

#: Elements of this library and of other codes.
ELEMENTS = ("P2, 3 points", "P2, mean stretch", "macro, triangles", "Q4, one point")


class OnNets(Specimen):
    """A specimen on nets along its singular fibres; quadrilaterals are split ones."""

    def mesh(self, cells: str, n: float, seed: int) -> Mesh:
        """A net with roughly n edges along a clamp, after any splitting."""
        if cells == "quads":
            return split(self.mesh("triangles", n / 2, seed))
        W, H = self.sides
        scene = self.scene(super().mesh("quads", EDGES, seed))
        outline = Outline([[0.0, W, W, 0.0], [0.0, 0.0, H, H]])
        fabric = self.fabric(scene)
        return mesh_outline(outline, fabric, scene.conditions, density=n / EDGES)


_BIAS = PROBLEMS["bias_extension"]

#: The bias extension by kind of mesh.
MESHES = {"irregular": _BIAS, "net": OnNets(**vars(_BIAS) | {"name": "on nets"})}


@dataclass(frozen=True)
class Meshing:
    """Generation of meshes of triangles."""

    seed: int
    kind: str

    def __str__(self) -> str:
        return f"{self.kind}, generation, seed {self.seed}"

    def rows(self) -> list[Row]:
        """Elements and run time, after one warm-up run."""
        sizes = ACROSS[self.kind]
        return [self._timed(n) for n in (sizes[0], *sizes)][1:]

    def _timed(self, across: int) -> Row:
        start = perf_counter()
        mesh = MESHES[self.kind].mesh("triangles", across // 2, self.seed)
        return {
            "scene": self.kind,
            "code": MESHING,
            "element": "",
            "solver": "",
            "seed": self.seed,
            "across": across,
            "elements": mesh.nelements,
            "seconds": perf_counter() - start,
        }


def all_cases() -> Iterator[Timed | Meshing]:
    """Seed by seed, every code on both kinds of meshes in turn."""
    for seed in SEEDS:
        for kind in MESHES:
            yield Meshing(seed, kind)
        for code, (kind, problem) in product(_codes(), MESHES.items()):
            yield Timed(seed, kind, problem, code, ACROSS[kind])


def _codes() -> Iterator[Any]:
    for code in CODES:
        if isinstance(code, OtherCode):
            chosen = code.rival.shape in (TRIANGLE6, QUAD4_CENTRE)
        else:
            chosen = code.element in ELEMENTS
        if chosen and code.solver in SETS["fastest"]:
            yield code
