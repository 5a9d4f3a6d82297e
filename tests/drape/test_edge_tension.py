"""Tension on the edges of plies on tools: tractions of a net at each load factor."""

import numpy as np
import pytest

from skfem_textile import OnSurface, drape
from skfem_textile.fabric import Linear
from skfem_textile.scenes.edge_tension import EdgeTension
from skfem_textile.solve.surface import Grown
from tests.helpers.laid_plies import square

TENSION = 2.0
TOUCH = 20.0, -10.0


def valley(x, y):
    """Without symmetry, and level at the touching point."""
    x, y, one = (x - TOUCH[0]) / 80, (y - TOUCH[1]) / 80, np.ones_like(x)
    return drape.Height(
        20 * (2 * x * x - x * y + y * y + x**3),
        (4 * x - y + 3 * x * x) / 4,
        (2 * y - x) / 4,
        (4 + 6 * x) / 320,
        -one / 320,
        2 * one / 320,
    )


TOOLS = {
    "sphere": drape.Sphere(100.0, (*TOUCH, -100.0)),
    "valley": drape.HeightField(valley),
}


def tractions(surface, t, fibres, held, angle=90.0, tension=TENSION):
    """Nodal forces at a load factor, shape (3, n_nodes)."""
    start = 0.0 if held else -50.0
    angles = tuple(np.radians([fibres, fibres + angle]))
    on_tool = OnSurface(surface, touch=TOUCH)
    load = EdgeTension(on_tool, tension, angles, Linear(0.5), held)
    corner = start + np.array(TOUCH)
    ply = square(60.0 - start, 6, loads=[load], corner=corner)
    return ply.nodal(ply.load(ply.basis.zeros(), t))


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize(
    ("fibres", "angle", "held"),
    [
        *((fibres, 90.0, ("left", "bottom")) for fibres in (0.0, 90.0, 45.0, -45.0)),
        (17.0, 90.0, ()),
        (33.0, 70.0, ()),
    ],
)
@pytest.mark.parametrize("t", [0.1, 0.6])
def test_tractions_are_those_of_the_net_at_their_load_factor(
    tool, fibres, angle, held, t
):
    """That net is laid on the surface as it has grown, as if it were the tool."""
    surface, given = TOOLS[tool], {"fibres": fibres, "angle": angle, "held": held}
    grown = Grown(surface, np.array([*TOUCH, 0.0]), t)
    expected = tractions(grown, 1.0, tension=t * TENSION, **given)
    found = tractions(surface, t, **given)
    off = np.abs(found - expected).max()
    assert off < 5e-4 * np.abs(expected).max()


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("fibres", [0.0, 45.0, 17.0])
def test_tractions_begin_along_the_fibres_of_the_flat_ply(tool, fibres):
    t, given = 1e-3, {"fibres": fibres, "held": ()}
    plane = drape.Plane()
    flat = tractions(plane, 1.0, **given)
    begun = tractions(TOOLS[tool], t, **given) / t
    assert np.abs(begun - flat).max() < 2e-3 * np.abs(flat).max()
    at_rest = tractions(TOOLS[tool], 0.0, **given)
    assert np.abs(at_rest).max() < 1e-6 * np.abs(flat).max()
