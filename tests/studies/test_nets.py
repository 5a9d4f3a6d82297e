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


def timing(mesh, element, code):
    return next(x for x in study.timings(ROWS) if x[:3] == (mesh, element, code))


def test_a_gain_is_the_ratio_of_two_times_to_one_error():
    slow, fast = (timing("net", STANDARD, code) for code in ("DOLFINx", OURS))
    ratios = [study.gain(slow, fast, level) for level in LEVELS]
    assert ratios == [("", pytest.approx(0.5)), ("", pytest.approx(2)), None]


def test_a_time_to_an_error_that_is_not_reached_is_a_bound():
    irregular, net = (timing(x, STANDARD, "DOLFINx") for x in MESHES)
    assert study.gain(irregular, net, 0.01) == (">", pytest.approx(8.0 / 0.4))
    assert study.gain(irregular, net, 0.005) is None
    irregular, net = (timing(x, "macro", OURS) for x in MESHES)
    assert study.gain(irregular, net, 0.01) == ("<", pytest.approx(4.0 / 0.5))


def test_tables_have_the_time_the_unknowns_and_the_error():
    assert (
        "| net | P2, 3 points | DOLFINx | 0.05 s, 400, 1.3 % | 0.4 s, 800, 0.7 % |"
        in (study.times(ROWS))
    )
    assert "| not reached: 90 % in 3 s |" in study.times(ROWS)


def test_words_compare_the_codes_on_nets():
    words = STUDY.figures(ROWS)
    assert [words[f"codes_{level}"] for level in ("3", "1", "0.5")] == ["0.5", "2", "-"]
    assert (words["net_reached_1"], words["net_reached_0.5"]) == ("2 of 2", "0 of 2")
    assert words["ours_1_solves"] == words["codes_1_solves"] == "5"
    assert words["ours_0.5_solves"] == words["codes_0.5_solves"] == "-"


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
