"""Results to draw, and a record of sheets in place of pictures.

Nothing here imports packages for drawing: without them the tests are skipped.
"""

from functools import cache

import pytest

from skfem_textile import Fabric, Full, LoadStepper, OnePoint, Ply, Yarns, scenes
from tests.helpers.forming import hemisphere, stopped  # noqa: F401


@cache
def of_strip():
    """Two results to be drawn, not to be changed."""
    scene = scenes.strip(size=(3, 4))
    fabric = Fabric(1e4, yarns=Yarns((2.0, 2.0), (1.5, 1.5), friction_moment=0.1))
    return [
        LoadStepper(Ply(scene.mesh, fabric, f), scene.conditions, steps=4).run()
        for f in (Full(), OnePoint(10.0))
    ]


@pytest.fixture(scope="session")
def results():
    return of_strip()


@pytest.fixture(scope="session")
def result(results):
    return results[0]


def own(result):
    """Basis, displacement and fabric of a result."""
    return result.ply.basis, result.u, result.ply.fabric


@pytest.fixture(scope="session")
def draped():
    """A ply on a hemisphere."""
    scene = scenes.hemisphere(size=(4, 4))
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft)
    return scenes.Case(scene=scene, fabric=fabric, steps=1).run()


@pytest.fixture
def sheets(monkeypatch):
    """Every sheet of a picture, with its layout; nothing is drawn."""
    from skfem_textile.plot import drawing, pictures

    recorded = []

    def draw(sheet, filename, plotter, size):
        recorded.append((sheet, drawing.lay_out(sheet, size)))

    monkeypatch.setattr(pictures, "draw", draw)
    return recorded
