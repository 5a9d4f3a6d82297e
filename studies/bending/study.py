"""24 bending laws by an independent evaluation, cantilevers and a published curve."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from skfem import MeshQuad

from skfem_textile import Bilinear, Fabric, Linear, OnePoint, Ply, Polynomial, Tabulated
from skfem_textile.ply.formulations import Macro, Quadratic
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Case, cantilever
from skfem_textile.scenes.elastica import drooping

from ..common.tables import grouped, table
from ..study import Part, Row, Study
from . import oracle

DATA = Path(__file__).parent

#: Weight of the binder fabric in N/mm², and its stiffness at small curvatures in N·mm.
WEIGHT, AT_REST = 13.6e-6, 119.2

#: Seeds of the random laws of each kind.
SEEDS = range(4)

KINDS = (
    *("bilinear", "odd polynomial", "polynomial of both signs"),
    *("odd table", "table of both signs", "bilinear table"),
)

#: Load numbers w L³/D of the published curve at which cantilevers are computed.
NUMBERS = (1.0, 5.0, 10.0, 50.0, 100.0)


def binder() -> Tabulated:
    """Moment over curvature of the binder fabric."""
    file = DATA / "binder_fabric_moment.csv"
    x, y = np.loadtxt(file, delimiter=",", skiprows=3).T
    return Tabulated(1e-3 * x, y, "linear", odd=True)


#: Laws of the cantilevers.
LAWS: dict[str, Any] = {
    "linear": Linear(AT_REST),
    "stiffening": Polynomial((AT_REST, 0.0, 4e5)),
    "bilinear": Bilinear(AT_REST, knee=2.4e-3, further_stiffness=40.0),
    "binder fabric": binder(),
}

#: Numbers of elements along a cantilever.
ELEMENTS = 16, 32, 64

FORMULATIONS: dict[str, Formulation] = {"macro": Macro(), "quadratic": Quadratic()}


def tip(law: Any, length: float, weight: float) -> tuple[float, float]:
    """Tip of a cantilever along x and down: M′ = −w (L − s) cos θ, θ′ = κ(M).

    The moment at the clamp is found such that it vanishes at the tip, as the largest
    such moment.
    """
    kappa = np.linspace(0.0, 0.06, 60_001)
    moments = law.value(kappa)

    def run(M: float) -> ndarray:
        def rates(s: float, y: ndarray) -> list[float]:
            bent = np.interp(abs(y[0]), moments, kappa) * np.sign(y[0])
            c = np.cos(y[1])
            return [-weight * (length - s) * c, bent, c, np.sin(y[1])]

        found = solve_ivp(
            rates, (0.0, length), [M, 0.0, 0.0, 0.0], rtol=1e-9, atol=1e-12
        )
        return found.y[:, -1]

    most = 0.5 * weight * length**2
    every = np.geomspace(1.0001, 0.05, 40) * most
    high = next(M for M in every if run(M)[0] < 0)
    low = every[np.flatnonzero(every == high)[0] - 1]
    _, _, x, drop = run(brentq(lambda M: run(M)[0], high, low, xtol=1e-13))
    return float(x), float(drop)


@dataclass(frozen=True)
class RandomLaw:
    """A random law on a random displacement of a strip."""

    kind: str
    seed: int

    def __str__(self) -> str:
        return f"law {self.kind} {self.seed}"

    def rows(self) -> list[Row]:
        random = np.random.default_rng([KINDS.index(self.kind), self.seed])
        law, energy = _random_law(self.kind, random)
        nx, ny, h = 5, 3, 4.0
        mesh = MeshQuad.init_tensor(*(h * np.arange(n + 1) for n in (nx, ny)))
        ply = Ply(
            *(mesh.with_defaults(), Fabric(1e3, 0.1, bending=(law, 0.0)), OnePoint()),
            dimension=3,
            fibre_ends={"left": "clamped"},
        )
        order = np.lexsort(ply.nodes)  # row by row
        u, d, e = (random.uniform(-1.0, 1.0, (ny + 1, nx + 1, 3)) for _ in range(3))
        u *= 0.15 * h

        def dofs(field: ndarray) -> ndarray:
            at_nodes = np.empty((order.size, 3))
            at_nodes[order] = field.reshape(-1, 3)
            return at_nodes.ravel()

        term: Any = next(term for term in ply.terms if term.name == "bending")
        strip = oracle.Strip(nx, ny, h, energy)
        v, along, other = map(dofs, (u, d, e))
        pairs = {
            "energy": (term.energy(v, 1.0), float(np.real(strip.energy(u + 0j)))),
            "force": (term.residual(v, 1.0) @ along, strip.gradient(u, d)),
            "tangent": (
                along @ (term.tangent(v, 1.0) @ other),
                strip.second(u, d, e, 1e-3),
            ),
        }
        errors = {f"{name}_error": a / b - 1 for name, (a, b) in pairs.items()}
        return [{"case": str(self), "kind": self.kind, **errors}]


def _random_law(kind: str, random: np.random.Generator) -> tuple[Any, Any]:
    """A law, and its energy by the oracle."""
    D, knee = random.uniform(1.0, 10.0), random.uniform(0.01, 0.05)
    if kind == "bilinear":
        numbers = D, knee, D * random.uniform(0.05, 3.0), random.uniform(0.05, 1.0)
        return Bilinear(*numbers), oracle.bilinear(*numbers)
    if "polynomial" in kind:
        scale = D / np.array([1.0, 0.2, 0.02, 0.01, 1e-3])
        c = scale * random.uniform(0.2, 1.0, 5)
        if kind == "odd polynomial":
            c[1::2] = 0.0
        return Polynomial(tuple(c)), oracle.polynomial(tuple(c))
    x = np.cumsum(random.uniform(0.02, 0.1, 8))
    y = D * np.cumsum(random.uniform(0.005, 0.05, 8))
    if kind == "bilinear table":
        x, y = np.array([0.0, knee, 1.0]), D * np.array([0.0, knee, 2 * knee + 0.1])
    else:
        x, y = np.append(0.0, x), np.append(0.0, y)
    every = np.concatenate([-x[:0:-1], x]), np.concatenate([-y[:0:-1], y])
    if kind == "table of both signs":
        every = every[0], every[1] * np.where(every[0] < 0, 0.4, 1.0)
        return Tabulated(*every), oracle.tabulated(*every)
    return Tabulated(x, y, odd=True), oracle.tabulated(*every)


@dataclass(frozen=True)
class Droop:
    """A cantilever of a law, by finite elements and by the differential equation."""

    law: str
    length: float
    formulation: str
    elements: int

    def __str__(self) -> str:
        return f"droop {self.law} {self.length:g} {self.formulation} {self.elements}"

    def rows(self) -> list[Row]:
        exact = tip(LAWS[self.law], self.length, WEIGHT)
        found = _tip_of(
            LAWS[self.law], self.length, self.formulation, self.elements, WEIGHT
        )
        off = float(np.hypot(*np.subtract(found, exact)))
        return [
            {
                "case": str(self),
                "law": self.law,
                "length_mm": self.length,
                "formulation": self.formulation,
                "elements": self.elements,
                "drop_mm": found[1],
                "ode_drop_mm": exact[1],
                "tip_error_over_length": off / self.length,
            }
        ]


def _tip_of(
    law: Any, length: float, formulation: str, elements: int, weight: float
) -> tuple[float, float]:
    made = FORMULATIONS[formulation]
    n = elements // (2 if isinstance(made, Macro) else 1)
    strip = cantilever(*("irregular", (n, 1), 0.0, 1), length=length, weight=weight)
    fabric = Fabric(1e4, 0.1, strip.warp, strip.weft, bending=(law, 0.0))
    run = Case(scene=strip, fabric=fabric, formulation=made, steps=4).run()
    figures = strip.summary(run)
    return figures["tip_x_mm"], -figures["tip_z_mm"]


@dataclass(frozen=True)
class Master:
    """Drop over extent at a load number, published and computed."""

    number: float

    def __str__(self) -> str:
        return f"master {self.number:g}"

    def rows(self) -> list[Row]:
        file = DATA / "cantilever_master_curve.csv"
        known = np.loadtxt(file, delimiter=",", skiprows=3)
        published = float(known[known[:, 0] == self.number][0, 1])
        length = 100.0
        weight = self.number * AT_REST / length**3
        shape = drooping(np.ones_like, [self.number ** (1 / 3)], 1.0, 2000)
        ratio = float(shape.drop[0] / shape.x[0])
        row = {
            "case": str(self),
            "number": self.number,
            "published": published,
            "elastica_error": ratio / published - 1,
            "elements_error": "",
        }
        if self.number in NUMBERS:
            x, drop = _tip_of(Linear(AT_REST), length, "macro", 64, weight)
            row["elements_error"] = drop / x / published - 1
        return [row]


def of_laws(rows: list[Row]) -> str:
    """Largest errors of the random laws by kind."""
    found = []
    for kind in KINDS:
        own = [row for row in rows if row["kind"] == kind]
        worst = {
            name: max((abs(row[name]) for row in own), default=np.nan)
            for name in ("energy_error", "force_error", "tangent_error")
        }
        found.append({"kind": kind, "laws": len(own), **worst})
    return table(
        found,
        {
            "law": "{kind}",
            "number": "{laws}",
            "energy": "{energy_error:.1e}",
            "forces": "{force_error:.1e}",
            "tangent": "{tangent_error:.1e}",
        },
    )


def of_cantilevers(rows: list[Row]) -> str:
    """Drop at 32 elements, and errors of the tip by the number of elements."""
    found = []
    for (law, length, formulation), own in grouped(
        rows, "law", "length_mm", "formulation"
    ).items():
        errors = {f"at_{row['elements']}": row["tip_error_over_length"] for row in own}
        fine = next((row for row in own if row["elements"] == ELEMENTS[1]), own[0])
        named = {"law": law, "length": length, "formulation": formulation}
        found.append(
            dict.fromkeys(map("at_{}".format, ELEMENTS)) | named | errors | fine
        )
    return table(
        found,
        {
            "law": "{law}",
            "length, mm": "{length:g}",
            "elements": "{formulation}",
            "drop, mm": "{drop_mm:.2f}",
            "exact, mm": "{ode_drop_mm:.2f}",
            **{f"tip error/L, {n}": f"{{at_{n}:.1e}}" for n in ELEMENTS},
        },
    )


def of_master(rows: list[Row]) -> str:
    """The published curve."""
    computed = [row for row in rows if row["elements_error"] != ""]
    return table(
        computed,
        {
            "w L³/D": "{number:g}",
            "drop over extent, published": "{published:.4f}",
            "error of the elastica": "{elastica_error:+.2%}",
            "error of 64 elements": "{elements_error:+.2%}",
        },
    )


class Bending(Study[Any]):
    """Bending laws."""

    parts = (
        Part("laws.csv", {"laws.md": of_laws}, cases=("law *",)),
        Part("cantilevers.csv", {"cantilevers.md": of_cantilevers}, cases=("droop *",)),
        Part("master.csv", {"master.md": of_master}, cases=("master *",)),
    )
    sample = "law table of both signs 0"

    def cases(self, options: argparse.Namespace) -> Sequence[Any]:
        curve = np.loadtxt(
            DATA / "cantilever_master_curve.csv", delimiter=",", skiprows=3
        )
        return [
            *(RandomLaw(kind, seed) for kind in KINDS for seed in SEEDS),
            *(
                Droop(law, length, formulation, n)
                for law in LAWS
                for length in (200.0, 250.0)
                for formulation in FORMULATIONS
                for n in ELEMENTS
            ),
            *(Master(float(number)) for number in curve[:, 0]),
        ]


STUDY = Bending()
