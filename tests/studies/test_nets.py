import argparse

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile.mesh.selection import SINGULAR
from studies.error_time.cases import PROBLEMS, ThisLibrary, Timed
from studies.error_time.nets import study
from studies.error_time.nets.cases import EDGES, MESHES, SEEDS
from studies.error_time.nets.study import LEVELS, STANDARD, STUDY

OURS = ThisLibrary.code


def runs(mesh, code, element, across, seconds, error, solver="fastest"):
    """A row for each seed."""
    return [
        {
            **{"scene": mesh, "code": code, "element": element, "solver": solver},
            **{"seed": seed, "across": across, "unknowns": 100 * across},
            **{"steps": 1, "linear_solves": 5, "load": 1.0, "error": error},
            **{"seconds": seconds, "note": ""},
        }
        for seed in SEEDS
    ]


ROWS = [
    *runs("irregular", OURS, STANDARD, 32, 3.0, 0.9),
    *runs("irregular", OURS, "macro", 8, 1.0, 0.02),
    *runs("irregular", OURS, "macro", 16, 4.0, 0.009),
    *runs("irregular", "DOLFINx", STANDARD, 32, 8.0, 0.9, "MUMPS"),
    *runs("net", OURS, STANDARD, 4, 0.1, 0.013),
    *runs("net", OURS, STANDARD, 8, 0.2, 0.007),
    *runs("net", OURS, "macro", 4, 0.5, 0.013),
    *runs("net", "DOLFINx", STANDARD, 4, 0.05, 0.013, "MUMPS"),
    *runs("net", "DOLFINx", STANDARD, 8, 0.4, 0.007, "MUMPS"),
]


def gains():
    return {gain.key: gain for gain in study.gains(ROWS)}


def test_a_gain_is_the_ratio_of_two_times_to_one_error():
    code = gains()[f"code_dolfinx_{OURS}_net_p2_3_points"]
    assert [code.text(level) for level in LEVELS] == ["0.5", "2", "-"]
    element = gains()["element_p2_3_points_macro_net_skfem_textile"]
    assert element.ratio(0.03) == ("", pytest.approx(0.2))


def test_a_time_to_an_error_that_is_not_reached_is_a_bound():
    mesh = gains()["mesh_irregular_net_p2_3_points_dolfinx"]
    assert mesh.ratio(0.01) == (">", pytest.approx(8.0 / 0.4))
    assert mesh.text(0.005) == "-"
    other = gains()["mesh_irregular_net_macro_skfem_textile"]
    assert [other.text(level) for level in LEVELS[:2]] == ["2", "< 8"]


def test_gains_differ_in_one_cause_and_one_end_reaches_an_error():
    for gain in gains().values():
        assert sum(a != b for a, b in zip(*(x[:3] for x in gain[1:]), strict=True)) == 1
    # Neither code reaches an error with this element on irregular meshes.
    assert f"code_dolfinx_{OURS}_irregular_p2_3_points" not in gains()
    assert {gain.cause for gain in gains().values()} == {"mesh", "element", "code"}


def test_tables_have_the_time_the_unknowns_and_the_error():
    assert (
        "| net | P2, 3 points | DOLFINx | 0.05 s, 400, 1.3 % | 0.4 s, 800, 0.7 % |"
        in (study.times(ROWS))
    )
    assert "| not reached: 90 % in 3 s |" in study.times(ROWS)


def test_words_name_the_fastest_of_this_library_and_of_other_codes():
    words = STUDY.figures(ROWS)
    assert words["irregular_ours_1"] == "4 s"
    assert words["irregular_ours_1_element"] == "macro, this library"
    assert words["irregular_others_1"] == "not reached"
    assert words["net_others_3"] == "0.05 s"
    assert words["codes_3"] == "0.5"
    assert words["codes_0.5"] == "-"
    assert words["irregular_reached_3"] == "0 of 2"
    assert words["net_reached_1"] == "2 of 2"
    assert words["densities"].endswith("1 and 1.5")
    assert words[f"net_{OURS}_p2_3_points_1_unknowns"] == "800"


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


def test_every_code_is_timed_on_both_kinds_of_meshes_in_turn():
    timed = [
        case
        for case in STUDY.cases(argparse.Namespace())
        if isinstance(case, Timed) and case.seed == 1
    ]
    assert [case.scene for case in timed] == [*MESHES] * (len(timed) // 2)
    assert [case.code for case in timed[::2]] == [case.code for case in timed[1::2]]
    standard = {case.code.code for case in timed if case.code.element == STANDARD}
    assert standard == {OURS, "FElupe", "scikit-fem", "scikit-fem-native", "DOLFINx"}


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
