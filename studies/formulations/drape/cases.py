"""The cases of the study: a ply on the sphere in many ways, nets, rolled plies."""

from collections.abc import Iterator
from dataclasses import dataclass

from skfem_textile import Macro, OnePoint
from skfem_textile.ply.terms import Formulation

from .published import DRAPINGS

FORMULATIONS: dict[str, Formulation] = {"macro": Macro(), "one point": OnePoint()}

#: What a case may be.
SPHERE, NET, ROLLED, PUBLISHED = "sphere", "net", "rolled", "published"


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes
    ----------
    kind
        One of `SPHERE`, `NET`, `ROLLED` and `PUBLISHED`.
    parts
        Parts of elements a side: macro-elements have two of them a side.  Of a
        published net, how many cells a side take the place of one.
    formulation
        Name of `FORMULATIONS`.
    stretch, tension
        E and the tension on the free edges in N/mm; G is 0.1 N/mm.
    distortion
        Largest move of nodes as a share of the element size.
    surface
        How the sphere is given, analytic or as 5000 triangles; what a ply is rolled on;
        which of the published drapings.
    start
        Exponential map or net.
    """

    kind: str
    parts: int
    formulation: str = "one point"
    stretch: float = 1e5
    tension: float = 2.0
    distortion: float = 0.0
    surface: str = "analytic"
    start: str = "exponential map"

    def __str__(self) -> str:
        words = [self.kind, f"{self.parts} parts"]
        if self.kind == PUBLISHED:
            words.append(self.surface)
        elif self.kind != NET:
            words += [self.formulation, f"E={self.stretch:g}", f"q={self.tension:g}"]
            words += [f"moved {self.distortion:g}", self.surface, self.start]
        return ", ".join(words)


def all_cases() -> Iterator[Case]:
    """All cases, those of one table one after the other."""
    for name in FORMULATIONS:
        for parts in (8, 16, 32, 64, 128):
            yield Case(SPHERE, parts, name)
    for name in FORMULATIONS:
        for parts in (16, 32, 64):
            yield Case(SPHERE, parts, name, distortion=0.2)
        for stretch in (1e3, 1e4):
            yield Case(SPHERE, 32, name, stretch)
        yield Case(SPHERE, 32, name, start="net")
        yield Case(SPHERE, 32, name, surface="triangles")
        yield Case(SPHERE, 32, name, tension=0.0)
    for parts in (16, 32, 64):
        yield Case(NET, parts)
    for name in DRAPINGS:
        for parts in (1, 2):
            yield Case(PUBLISHED, parts, surface=name)
    for surface in ("cylinder, 0/90", "cylinder, ±45", "cone, 0/90"):
        for name in FORMULATIONS:
            for parts in (16, 32, 64):
                yield Case(ROLLED, parts, name, tension=1.0, surface=surface)
