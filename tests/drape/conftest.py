"""Tool and mesh sizes shared by the draping tests."""

import pytest

from skfem_textile.scenes import draped_ply, on_tool
from tests.helpers.intervals import no_interval  # noqa: F401
from tests.helpers.tools import plate, write


@pytest.fixture(scope="session")
def tool(tmp_path_factory):
    return write(tmp_path_factory.mktemp("tool") / "bump.stl", *plate())


@pytest.fixture
def coarse_net(monkeypatch):
    """Coarser nets for plies whose edges are not pulled by a net."""
    for module in (draped_ply, on_tool):
        monkeypatch.setattr(module, "CELLS", 16)
