"""Error intervals of random specimens contain the load of a fine net.

Classes differ in element, mesh and law, with shear laws beside their pole and fibres
that are nearly aligned with the load.  An interval may be absent, with its reason.
"""

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import strategies as st

from skfem_textile import (
    Condition,
    Fabric,
    Linear,
    LoadStepper,
    Locking,
    Macro,
    OnePoint,
    Outline,
    Ply,
    Quadratic,
    Sin2,
    StepError,
    mesh_outline,
)
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.interval import work_of
from tests.helpers.hostile import RIGHT, Family, expect, rejected, seeds

WIDTH, FINE = 50.0, 2.0
ON_NETS, STIFFER = Quadratic(400.0, points=6), Quadratic(4000.0, points=6)

# Formulation and mesh of each class; None for a net.
CLASSES: dict[str, tuple[Any, str | None]] = {
    "one point, triangles": (OnePoint(), "delaunay"),
    "one point, net": (OnePoint(), None),
    "one point, quadrilaterals": (OnePoint(), "irregular"),
    "macro, triangles": (Macro(), "delaunay"),
    "macro, quadrilaterals": (Macro(), "irregular"),
    "quadratic, net": (ON_NETS, None),
}
LAWS = "linear", "sin²", "locking", "steep"

# Share of the half-width by which the error may exceed it.
EXCESS = 0.1


class Specimen(NamedTuple):
    """A bias extension by seed, of a class and a law."""

    seed: int
    kind: str
    law: str


@st.composite
def specimens(draw, kind):
    return Specimen(draw(seeds), kind, draw(st.sampled_from(LAWS)))


def problem(random, law):
    """Outline, fabric and conditions.

    The fibres of ``steep`` end between 78 and 85° to the clamps, and the shear angle of
    ``locking`` between 80 and 95 % of its pole.
    """
    E, G = 10 ** random.uniform(3.5, 5), 10 ** random.uniform(-1, 0.3)
    angle = np.radians(random.uniform(*((58, 66) if law == "steep" else (32, 55))))
    height = max(80.0, WIDTH * np.tan(angle)) * random.uniform(1.1, 1.5)
    free = (height / np.sin(angle) - WIDTH / np.cos(angle)) / 2
    shear_angle = np.radians(random.uniform(8, 35))
    shear: Any = Sin2(G) if law == "sin²" else Linear(G)
    if law == "steep":
        shear_angle = 2 * (np.radians(random.uniform(78, 85)) - angle)
    if law == "locking":
        pole = np.radians(random.uniform(45, 60))
        shear_angle = pole * random.uniform(0.8, 0.95)
        shear = Locking(G, pole)
    pull = 2 * free * (np.sin(angle + shear_angle / 2) - np.sin(angle))
    c, s = np.cos(angle), np.sin(angle)
    fabric = Fabric(E, shear, (c, s), (-c, s))
    outline = Outline([[0, WIDTH, WIDTH, 0], [0, 0, height, height]])
    held = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, pull))}
    return outline, fabric, held, height


def loaded(mesh, fabric, held, formulation):
    """Result, and the work of the load in N·mm."""
    stepper = LoadStepper(Ply(mesh, fabric, formulation), held, 1)
    result = stepper.run()
    return result, work_of(stepper.problem.at(1.0), result.states[-1])


def attempt(specimen):
    random = np.random.default_rng(specimen.seed)
    outline, fabric, held, height = problem(random, specimen.law)
    formulation, kind = CLASSES[specimen.kind]
    if kind is None:
        mesh = mesh_outline(outline, fabric, held)
    else:
        n = int(random.integers(7, 11))
        size, seed = (n, round(n * height / WIDTH)), int(random.integers(1000))
        mesh = rectangle(WIDTH, height, size, kind, 0.25, seed)
    try:
        result, work = loaded(mesh, fabric, held, formulation)
        fine = mesh_outline(outline, fabric, held, density=FINE)
        works = [loaded(fine, fabric, held, x)[1] for x in (ON_NETS, STIFFER)]
    except StepError as error:
        return rejected(error)
    half = result.error.load
    if half is None:
        return rejected(result.error.reason)
    error = abs(work - np.mean(works)) / abs(work)
    uncertainty = np.ptp(works) / abs(work)
    expect(
        error <= (1 + EXCESS) * half + uncertainty,
        f"{specimen}: error {error:.2%}, half-width {half:.2%}, reference "
        f"{uncertainty:.2%}",
    )
    return RIGHT


FAMILY = Family(
    "intervals",
    {kind: specimens(kind) for kind in CLASSES},
    attempt,
    150,
    short=6,
    seconds=120.0,  # two references on fine nets
)


@pytest.mark.slow
def test_the_interval_of_a_specimen_contains_the_load_of_a_fine_net():
    for seed, kind, law in (
        (1, "one point, triangles", "linear"),
        (1, "quadratic, net", "locking"),
        (111, "macro, triangles", "locking"),
    ):
        assert attempt(Specimen(seed, kind, law)) == RIGHT
