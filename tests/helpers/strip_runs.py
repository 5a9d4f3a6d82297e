"""Runs on a small strip, and their interruption."""

from functools import cache

import numpy as np
import pytest

from skfem_textile import Fabric, LoadStepper, OnePoint, Ply
from skfem_textile.scenes import strip


def stepper(folder, steps=3, C_s=1.0, kind="energy", E=1e4, **options):
    scene = strip(size=(2, 3))
    ply = Ply(scene.mesh, Fabric(E), OnePoint(C_s, kind))
    return LoadStepper(ply, scene.conditions, steps, checkpoint=folder, **options)


def interrupted(load_factor, make, *arguments, **options):
    """Interrupt the run of a stepper that is made so, and leave its checkpoint."""

    def interrupt(state):
        if state.load_factor >= load_factor:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make(*arguments, on_step=interrupt, **options).run()


@cache
def whole_run(kind="energy", C_s=1.0):
    """The uninterrupted run."""
    return stepper(None, kind=kind, C_s=C_s).run()


def assert_same(result, other):
    np.testing.assert_array_equal(result.u, other.u)
    assert result.factorisations == other.factorisations
    assert result.steps_cut == other.steps_cut
    assert result.history() == other.history()
