"""Tool and mesh sizes shared by tests of draping."""

import pytest

from skfem_textile.scenes import draped_ply, edge_tension
from skfem_textile.solve import interval
from tests.helpers.intervals import OMITTED
from tests.helpers.tools import plate, write


@pytest.fixture(scope="module")
def quick():
    """Coarser nets, and no error intervals, for runs that a module shares."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interval, "error_interval", lambda *_: OMITTED)
        for module in (draped_ply, edge_tension):
            patch.setattr(module, "CELLS", 16)
        yield


@pytest.fixture(scope="session")
def tool(tmp_path_factory):
    return write(tmp_path_factory.mktemp("tool") / "bump.stl", *plate(n=15))


@pytest.fixture
def coarse_net(monkeypatch):
    """Coarser nets for plies whose edges are not pulled by a net."""
    for module in (draped_ply, edge_tension):
        monkeypatch.setattr(module, "CELLS", 16)
