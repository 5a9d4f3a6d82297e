"""The problems covered by the study."""

import numpy as np
import pytest

from studies.stability.problems import extremes


def test_flat_angles_are_flat():
    (problem,) = [p for p in extremes() if p.name == "strip, 2×2" and "179" in p.family]
    mesh = problem.scene().mesh
    x = mesh.p[:, mesh.t]
    ahead, behind = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    cosine = np.sum(ahead * behind, axis=0) / (
        np.linalg.norm(ahead, axis=0) * np.linalg.norm(behind, axis=0)
    )
    assert np.degrees(np.arccos(cosine)).max() == pytest.approx(179.0)
