from types import SimpleNamespace

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile.mesh.selection import SINGULAR
from studies.error_time.cases import PROBLEMS, Timed
from studies.error_time.fronts import Spread
from studies.error_time.nets import study
from studies.error_time.nets.cases import EDGES, MESHES
from studies.error_time.nets.study import STUDY


def timing(*points):
    """Times in seconds, and the errors that they reach."""
    return study.Timing(
        *("net", "P2", "code"),
        [SimpleNamespace(seconds=Spread(s, s, s), within=error) for s, error in points],
    )


def test_a_time_to_an_error_that_is_not_reached_is_a_bound():
    slow, fast = timing((1.0, 0.03), (8.0, 0.02)), timing((0.1, 0.02), (0.4, 0.01))
    assert study.gain(slow, fast, 0.02) == ("", pytest.approx(80))
    assert study.gain(slow, fast, 0.01) == (">", pytest.approx(20))
    assert study.gain(fast, slow, 0.01) == ("<", pytest.approx(0.05))
    assert study.gain(slow, fast, 0.005) is None


def test_errors_are_relative_to_the_converged_load():
    class Known:
        code, element, solver = "code", "Q4", "required"

        def missing(self):
            return ""

        def measured(self, problem, across, seed):
            load = None if across == 4 else 1.01 * study._converged()
            return {"seconds": 0.1, "note": "", "across": across, "load": load}

    assert study._converged() == pytest.approx(43.207, abs=0.002)
    failed, row = STUDY.examine(Timed(1, "net", MESHES["net"], Known(), (4, 6)))
    assert "error" not in failed
    assert row["error"] == pytest.approx(0.01)


def test_a_net_has_the_singular_fibres_as_edges_and_roughly_the_size():
    specimen = MESHES["net"]
    for n in (EDGES, EDGES / 2):
        mesh = specimen.mesh("triangles", n, 1)
        assert len(mesh.boundaries["bottom"]) == pytest.approx(n, rel=0.5)
        x, y = mesh.p[:, mesh.facets[:, mesh.boundaries[SINGULAR]]]
        np.testing.assert_allclose(
            np.abs(np.diff(x, axis=0)), np.abs(np.diff(y, axis=0))
        )
    quads = specimen.mesh("quads", EDGES, 1)
    assert isinstance(quads, MeshQuad)
    assert quads.nelements == 3 * mesh.nelements
    assert specimen.E == PROBLEMS["bias_extension"].E
