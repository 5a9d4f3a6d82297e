"""Corners that carry more than a hundredth of the energy are reported."""

from types import SimpleNamespace

import numpy as np
import pytest

from skfem_textile.solve import verdict


@pytest.mark.parametrize(("share", "reported"), [(0.009, False), (0.011, True)])
def test_the_share_of_corners_is_limited(share, reported, monkeypatch):
    monkeypatch.setattr(verdict, "_point_supports", lambda *_: ())
    trial = SimpleNamespace(
        problem=None,
        equilibrium=SimpleNamespace(u=np.zeros(3)),
        energies={"tension": 2.0 * (1 - share), "corners": 2.0 * share},
        shares={},
    )
    found = dict(verdict._discretisation_checks(trial))
    assert list(found) == ["corners"] * reported
    if reported:
        assert "contributes 1% of the energy" in str(found["corners"])
