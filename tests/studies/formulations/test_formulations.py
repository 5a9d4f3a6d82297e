from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import (
    LoadStepper,
    OnePoint,
    Ply,
)
from studies.formulations import study
from studies.formulations.cases import (
    AUTO,
    BIAS,
    BIAS_SIN2,
    FRAME,
    STRIP,
    Case,
)
from studies.formulations.study import STUDY


def case(problem, method, across=4, seed=1, group="methods"):
    return Case(group, problem, method, across, seed)


def test_a_case_is_measured_at_40_degrees_and_its_load_at_every_angle():
    (row,) = STUDY.examine(case(BIAS[0], AUTO))
    scene = case(BIAS[0], AUTO).scene()
    ply = Ply(scene.mesh, BIAS[0].fabric(scene), OnePoint())
    result = LoadStepper(ply, scene.conditions, 5).run()
    at_40 = scene.summary(replace(result, states=result.states[:5]))
    assert row["load"] == row["load_40"] == pytest.approx(at_40["load_over_exact"])
    assert row["position"] == at_40["displacement_error_rms"]
    at_20 = scene.summary(replace(result, states=result.states[:3]))
    assert row["load_20"] == pytest.approx(at_20["load_over_exact"])
    assert row["mesh_fibre_strain"] == at_40["mesh_fibre_strain"] > row["strain"]
    assert not row["refused"]


def test_converged_loads_are_of_fibres_that_stretch():
    """They are below the loads of inextensible fibres."""
    assert study.exact_load(STRIP) == study.exact_load(FRAME) == 0
    for laws in (BIAS, BIAS_SIN2):
        soft, stiff, stiffest = map(study.exact_load, laws)
        assert soft < stiff < stiffest < 1
    assert study.exact_load(BIAS[1]) == pytest.approx(0.986, abs=0.001)


def test_the_load_is_the_force_along_the_prescribed_displacement():
    scene = case(STRIP, AUTO).scene()
    ply = Ply(scene.mesh, STRIP.fabric(scene), OnePoint())
    result = LoadStepper(ply, scene.conditions, 5).run()
    (row,) = STUDY.examine(case(STRIP, AUTO))
    assert row["load"] == pytest.approx(abs(scene.summary(result)["reaction_x"]))
    assert np.isnan(row["load_10"])
