"""The pull of a crimped fabric along the bisector of its fibres."""

import pytest

from skfem_textile import (
    Condition,
    CrimpToe,
    Fabric,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    split,
)
from skfem_textile.scenes.rectangle import rectangle


def load(mesh, formulation):
    """Force in N that lengthens 100 mm by 10 mm, fibres at 45 degrees."""
    fabric = Fabric(CrimpToe(1e5, 0.004, 10.0), 0.5, warp=(1, 1), weft=(-1, 1))
    pull = {"clamp": Condition("bottom"), "pull": Condition("top", (0, 10))}
    ply = Ply(mesh, fabric, formulation)
    return LoadStepper(ply, pull, steps=5).run().states[-1].reactions["pull"][1]


@pytest.fixture(scope="module")
def converged():
    """At 32 edges across, which 64 change by 0.12 %."""
    return load(rectangle(50, 100, (32, 64)), OnePoint())


@pytest.mark.parametrize("kind", ["irregular", "delaunay"])
def test_macro_elements_read_the_load_of_a_crimped_fabric(kind, converged):
    """At rest fibres are as soft as crimp, and deviations in elements must not be."""
    macro = load(split(rectangle(50, 100, (8, 16), kind)), Macro())
    assert macro == pytest.approx(converged, rel=0.02)
