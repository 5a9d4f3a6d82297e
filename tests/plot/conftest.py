"""A result to draw, and a record of drawn sheets.

Nothing here imports packages for drawing: without them the tests are skipped.
"""

import pytest

from skfem_textile import Fabric, Full, LoadStepper, Ply
from skfem_textile.scenes import strip


@pytest.fixture(scope="session")
def result():
    """To be drawn, not to be changed."""
    scene = strip(size=(3, 4))
    return LoadStepper(Ply(scene.mesh, Fabric(1e4), Full()), scene.conditions, 4).run()


@pytest.fixture
def sheets(monkeypatch):
    """Every sheet that is drawn, by pyvista or matplotlib, with its layout."""
    from skfem_textile.plot import drawing

    layouts, lay_out = [], drawing.lay_out

    def watched(drawn, size):
        layouts.append((drawn, lay_out(drawn, size)))
        return layouts[-1][1]

    monkeypatch.setattr(drawing, "lay_out", watched)
    return layouts
