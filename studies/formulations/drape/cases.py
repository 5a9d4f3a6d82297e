"""The cases of the study: a ply on the sphere in many ways, nets, rolled plies."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from skfem import CellBasis

from skfem_textile import Fabric, Full, Macro, OnePoint, Quadratic
from skfem_textile.ply.terms import Formulation, Term

from .published import DRAPINGS
from .rolled import BIAS, CYLINDER, FAN, SQUARES


class Flat(Macro):
    """Macro-elements that are stabilised in their plane alone."""

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """The hourglass term without that out of the plane."""
        every = super().stabilising_terms(basis, fabric)
        return [term for term in every if term.name != "out_of_plane"]


#: Name of what is stabilised in its plane alone.
FLAT = "macro, no C_s out of plane"

FORMULATIONS: dict[str, Formulation] = {
    "macro": Macro(),
    "one point": OnePoint(),
    FLAT: Flat(),
    "2×2 points": Full(),
    "quadratic triangles": Quadratic(80.0),
    "split triangles": Macro(),
}

#: What a case may be: on the sphere, on the clock, a net, a net beside one by a
#: published method, or rolled.
SPHERE, TIME, NET = "sphere", "time", "net"
PUBLISHED, ROLLED = "published", "rolled"

#: How a drape may start.
EXPONENTIAL, FROM_NET, GROWTH = "exponential map", "net", "growth"


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes
    ----------
    kind
        One of `SPHERE`, `TIME`, `NET`, `PUBLISHED` and `ROLLED`.
    parts
        Nodes a side less one: macro-elements and quadratic triangles are twice as
        large.  Of a published net, how many cells a side take the place of one.
    formulation
        Name of `FORMULATIONS`.
    stretch, tension
        E and the tension on the free edges in N/mm; G is 0.1 N/mm.
    bending
        D of both families in N·mm.
    distortion
        Largest move of nodes as a share of the element size.
    halvings
        How often the elements are halved after their nodes have moved.
    surface
        How the sphere is given, analytic or as 5000 triangles; what a ply is rolled on;
        which of the published drapings.
    start
        `EXPONENTIAL`, `FROM_NET` or `GROWTH`.
    """

    kind: str
    parts: int
    formulation: str = "one point"
    stretch: float = 1e5
    tension: float = 2.0
    bending: float = 0.0
    distortion: float = 0.0
    halvings: int = 0
    surface: str = "analytic"
    start: str = EXPONENTIAL

    def __str__(self) -> str:
        words = [self.kind, f"{self.parts} parts"]
        if self.kind == PUBLISHED:
            words.append(self.surface)
        elif self.kind != NET:
            words += [self.formulation, f"E={self.stretch:g}", f"q={self.tension:g}"]
            words += [
                f"D={self.bending:g}",
                f"moved {self.distortion:g}",
                f"halved {self.halvings}",
            ]
            words += [self.surface, self.start]
        return ", ".join(words)


def all_cases() -> Iterator[Case]:
    """All cases, those of one table one after the other."""
    both = "macro", "one point"
    for name, parts in product(both, (8, 16, 32, 64, 128)):
        yield Case(SPHERE, parts, name)
    for parts in (32, 64, 128):
        yield Case(SPHERE, parts, FLAT)
    for name, parts in product((*both, FLAT), (32, 64, 128)):
        yield Case(SPHERE, parts, name, stretch=1e6)
    for name in both:
        for parts in (16, 32, 64, 128):
            yield Case(SPHERE, parts, name, distortion=0.2)
        for halvings in (1, 2, 3):
            parts = 16 * 2**halvings
            yield Case(SPHERE, parts, name, distortion=0.2, halvings=halvings)
        for stretch in (1e3, 1e4):
            yield Case(SPHERE, 32, name, stretch)
        yield Case(SPHERE, 32, name, start=FROM_NET)
        yield Case(SPHERE, 32, name, surface="triangles")
        for parts, start in product((16, 32), (EXPONENTIAL, FROM_NET)):
            yield Case(SPHERE, parts, name, tension=0.0, start=start)
    for parts, bending in product((16, 32), (5.0, 10.0)):
        yield Case(SPHERE, parts, "macro", tension=0.0, bending=bending)
    for parts in (16, 32):
        yield Case(SPHERE, parts, "macro", tension=0.05)
    for parts in (16, 32, 64):
        yield Case(NET, parts)
    for name in DRAPINGS:
        for parts in (1, 2):
            yield Case(PUBLISHED, parts, surface=name)
    for how, q in (*product((CYLINDER, BIAS, FAN), (0.0, 1.0)), (SQUARES, 0.0)):
        for name, parts in product(both, (16, 32, 64)):
            yield Case(ROLLED, parts, name, tension=q, surface=how)
    timed = *both, "2×2 points", "quadratic triangles", "split triangles"
    starts = EXPONENTIAL, FROM_NET, GROWTH
    for name, start, parts in product(timed, starts, (8, 16, 32, 64)):
        yield Case(TIME, parts, name, start=start)
