from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from skfem_textile import (
    LoadStepper,
    OnePoint,
    PlainNewton,
    Ply,
)
from studies.formulations import cases, study
from studies.formulations.cases import (
    AUTO,
    BIAS,
    BIAS_SIN2,
    FRAME,
    MACRO,
    MACRO_TRIANGLES,
    MEAN_QUADRATIC,
    METHODS,
    STRIP,
    Case,
)
from studies.formulations.study import STUDY, in_words

ALL = list(cases.all_cases())


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


def test_loads_of_the_bias_extension_are_compared_with_converged_ones():
    """Fibres of finite stiffness stretch and have a smaller load than inextensible
    ones.
    """
    assert study.exact_load(STRIP) == study.exact_load(FRAME) == 0
    for laws in (BIAS, BIAS_SIN2):
        soft, stiff, stiffest = map(study.exact_load, laws)
        assert soft < stiff < stiffest < 1
    assert study.exact_load(BIAS[1]) == pytest.approx(0.986, abs=0.001)
    exact = study.exact_load(BIAS[0])
    rows = [{"load": 1.1 * exact}, {"load": 0.8 * exact}, {"load": 1.1 * exact}]
    assert study.load_error(rows, BIAS[0]) == pytest.approx(0.1)
    assert study.load_error(rows, STRIP) == pytest.approx(1.1 * exact)
    over = [row["load"] for row in study.over_exact(rows, BIAS[0])]
    assert over == pytest.approx([1.1, 0.8, 1.1])


def test_the_load_is_the_force_along_the_prescribed_displacement():
    scene = case(STRIP, AUTO).scene()
    ply = Ply(scene.mesh, STRIP.fabric(scene), OnePoint())
    result = LoadStepper(ply, scene.conditions, 5).run()
    (row,) = STUDY.examine(case(STRIP, AUTO))
    assert row["load"] == pytest.approx(abs(scene.summary(result)["reaction_x"]))
    assert np.isnan(row["load_10"])


def test_a_failed_case_keeps_its_last_state(monkeypatch):
    """Eight iterations of plain Newton do not reach 50° on these coarse triangles."""
    newton = partial(LoadStepper, method=PlainNewton(8), max_halvings=0)
    monkeypatch.setattr(cases, "LoadStepper", newton)
    (row,) = STUDY.examine(case(BIAS[2], METHODS[5], 8))
    assert "stopped at load factor 0.8" in row["refused"]
    assert row["load_40"] > 100
    assert np.isnan(row["load_50"])
    early = replace(BIAS[2], last=5)
    (row,) = STUDY.examine(case(early, METHODS[5], 8))
    assert np.isnan(row["position"])


def test_the_extreme_load_has_the_largest_error():
    rows = [
        {f"load_{a}": x * study.exact_load(BIAS[0], a) for a in (10, 20, 30, 40)}
        for x in (0.99, 1.02, 0.9)
    ]
    rows[2]["load_10"] = np.nan
    assert study.over_angles(rows, BIAS[0]) == pytest.approx((0.99, 0.9))
    assert np.isnan(study.over_angles([], BIAS[0])).all()


def test_a_value_missing_for_some_seeds_is_given_with_its_count():
    rows = [{"load": x} for x in (1.0, np.nan, 3.0)]
    assert study._cell(rows, "load") == "2 (2 of 3)"
    assert study._cell(rows[1:2], "load") == "-"


def test_words_are_ratios_of_medians_and_loads_of_largest_error():
    """On exact rows, except for the rows that a result describes."""
    rows = [
        {
            **{"group": c.group, "problem": c.problem.name, "method": c.method.name},
            **{"across": c.across, "refused": "", "position": 0.1},
            "load": study.exact_load(c.problem),
            **{f"load_{a}": _exact(c.problem, a) for a in study.CONVERGED_ANGLES},
        }
        for c in ALL
    ]
    words = in_words(rows)
    assert words["closer_where_smooth"] == words["locked"] == "1 to 1 times"
    assert words["quads_16"] == "+0.0 to +0.0 %"
    assert words["quadratic_mean_16_worst"] == "0.0 %"

    def change(problem, method, across=16, seeds=5, **factors):
        chosen = study.of(rows, "methods", problem, method, across)
        for row in chosen[:seeds]:
            row |= {key: row[key] * factor for key, factor in factors.items()}

    change(STRIP, MACRO, position=30)
    change(BIAS[0], cases.FULL, load=12)
    change(BIAS[2], cases.QUADRATIC, load=80)
    change(BIAS_SIN2[1], MACRO, load_20=1.05)
    change(BIAS[0], MACRO_TRIANGLES, 32, load_30=0.9)
    change(BIAS[0], MEAN_QUADRATIC, seeds=1, load_30=0.9)
    words = in_words(rows)
    assert words["closer_where_smooth"] == "1 to 30 times"
    assert words["locked"] == "1 to 80 times"
    assert words["quadratic"] == "80 times"
    assert words["quads_16"] == "+0.0 to +5.0 %"
    assert words["triangles_16"] == "+0.0 to +0.0 %"
    assert words["quadratic_mean_16_worst"] == "10.0 %"


def _exact(problem, angle):
    """The converged load, where there is one."""
    return study.exact_load(problem, angle) if problem.exact_load else np.nan
