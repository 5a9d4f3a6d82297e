"""Samples of a fabric on the command line: ``run --samples`` and its report."""

import csv
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from skfem_textile.calibration import Choice, Specimen, fit_tests
from skfem_textile.cli import main as cli
from skfem_textile.cli import samples
from skfem_textile.cli.samples import with_bands
from skfem_textile.io import read_fabric
from skfem_textile.scenes import Case
from skfem_textile.solve.quantities import BAND
from skfem_textile.sweep import ThisThread
from tests.helpers.command_line import fit, rejected, summary_in
from tests.helpers.curves import shear_files

RUN = [
    *("run", "picture_frame", "--fabric", "cao2008-plain-weave", "--size", "2x2"),
    *("--steps", "2", "--solver", "superlu", "--no-render"),
]


@pytest.fixture(autouse=True)
def in_this_thread(monkeypatch):
    monkeypatch.setattr(samples, "WorkerProcesses", lambda n: ThisThread())


def rows_of(out):
    return list(csv.DictReader((out / "samples.csv").read_text().splitlines()))


def test_a_run_states_the_band_of_each_figure_that_varies(tmp_path, capsys):
    out = tmp_path / "out"
    assert cli.main([*RUN, "--samples", "4", "--out", str(out)]) == 0
    summary, rows = summary_in(out), rows_of(out)
    loads = [float(row["load_N"]) for row in rows]
    assert [row["sample"] for row in rows] == ["1", "2", "3", "4"]
    assert summary["load_N_band"] == pytest.approx([min(loads), max(loads)])
    assert "displacement_mm_band" not in summary
    assert (summary["samples"], summary["samples_probability"]) == (4, 0.6)
    printed = capsys.readouterr().out
    low, high = (f"{x:.4g}" for x in summary["load_N_band"])
    assert f"samples {low} to {high}" in printed
    assert "with a probability of 60 % a band contains another one" in printed
    curve = list(csv.DictReader((out / "curve.csv").read_text().splitlines()))
    ends = [
        float(curve[-1][f"{x} force of the samples (N)"]) for x in ("lowest", "highest")
    ]
    assert ends == pytest.approx(summary["load_N_band"])


def test_the_law_of_a_sample_is_the_one_of_python(tmp_path):
    """The load of a picture frame is proportional to its moment."""
    out = tmp_path / "out"
    options = ["--samples", "3", "--set", "fabric.seed=7", "--out", str(out)]
    assert cli.main([*RUN, *options]) == 0
    loads = [float(row["load_N"]) for row in rows_of(out)]
    angle = np.radians([summary_in(out)["max_shear_angle_deg"]])
    found = read_fabric("cao2008-plain-weave").samples(3, seed=7)
    moments = [one.shear_law.value(angle)[0] for one in found]
    ratio = np.array(loads) / moments
    assert ratio == pytest.approx(np.full(3, ratio[0]), rel=1e-6)


def test_a_second_run_continues_the_samples_of_the_same_case(tmp_path, monkeypatch):
    out, called, run = tmp_path / "out", [], Case.run
    monkeypatch.setattr(Case, "run", lambda case: called.append(1) or run(case))
    for drawn, further, number in (
        ("2", [], 2),
        ("3", [], 3),
        ("3", ["--steps", "1"], 6),
    ):
        assert cli.main([*RUN, *further, "--samples", drawn, "--out", str(out)]) == 0
        assert len(called) == number


@pytest.mark.slow
@pytest.mark.parametrize("where", ["workers", "scheduler"])
def test_processes_and_dask_compute_the_same_bands(where, tmp_path, monkeypatch):
    one, other = tmp_path / "one", tmp_path / "other"
    assert cli.main([*RUN, "--samples", "3", "--out", str(one)]) == 0
    monkeypatch.undo()
    line = [*RUN, "--samples", "3", "--out", str(other)]
    if where == "workers":
        assert cli.main([*line, "--workers", "2"]) == 0
    else:
        distributed = pytest.importorskip("dask.distributed")
        options = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": ":0"}
        with distributed.LocalCluster(processes=True, **options) as cluster:
            assert cli.main([*line, "--scheduler", cluster.scheduler_address]) == 0
    bands = [summary_in(out)["load_N_band"] for out in (one, other)]
    assert bands[0] == pytest.approx(bands[1], rel=1e-9)


def test_samples_of_an_earlier_run_are_removed(tmp_path):
    out = tmp_path / "out"
    assert cli.main([*RUN, "--samples", "2", "--out", str(out)]) == 0
    assert cli.main([*RUN, "--out", str(out)]) == 0
    assert not (out / "samples.csv").exists()
    assert "samples" not in summary_in(out)


def test_an_interruption_keeps_the_run_and_the_completed_samples(
    tmp_path, monkeypatch, capsys
):
    out, called, run = tmp_path / "out", [], Case.run

    def interrupted(case):
        called.append(1)
        if len(called) == 2:
            raise KeyboardInterrupt
        return run(case)

    monkeypatch.setattr(Case, "run", interrupted)
    line = [*RUN, "--samples", "2", "--out", str(out)]
    assert cli.main(line) == 130
    assert "the same command continues" in capsys.readouterr().err
    assert summary_in(out)["converged"]
    assert len((out / "samples.jsonl").read_text().splitlines()) == 1
    assert cli.main(line) == 0
    assert len(called) == 3


def test_samples_that_stop_early_are_named(tmp_path, monkeypatch, capsys):
    out, called, run = tmp_path / "out", [], Case.run

    def stops(case):
        called.append(1)
        if len(called) == 2:
            raise ValueError("it folds")
        return run(case)

    monkeypatch.setattr(Case, "run", stops)
    assert cli.main([*RUN, "--samples", "3", "--out", str(out)]) == 1
    assert "sample 2 stopped early: it folds" in capsys.readouterr().err
    assert summary_in(out)["samples_stopped"] == 1
    assert [row["stopped"] for row in rows_of(out)] == ["", "", "it folds"]


def test_the_report_has_a_table_of_the_bands(tmp_path):
    out = tmp_path / "out"
    assert cli.main([*RUN, "--samples", "2", "--out", str(out)]) == 0
    assert cli.main(["report", str(out)]) == 0
    page = re.sub(r"<[^>]+>", " ", (out / "report.html").read_text())
    scatter = page[page.index("Scatter of the fabric") :]
    low = summary_in(out)["load_N_band"][0]
    assert f"{low:.4g}" in scatter[: scatter.index("Pictures")]


def test_a_picture_has_mesh_and_fabric_side_by_side(tmp_path, monkeypatch):
    curves = pytest.importorskip("skfem_textile.plot.curves")
    from skfem_textile.cli import results

    drawn = {}
    monkeypatch.setattr(
        curves, "curves", lambda panels, *of, **to: drawn.update(of=panels, **to)
    )
    out = tmp_path / "out"
    assert cli.main([*RUN, "--samples", "2", "--out", str(out)]) == 0
    from skfem_textile.cli.curve import read_test_curve

    results._draw_samples(read_test_curve(out / "curve.csv"), tmp_path)
    mesh, fabric = drawn["of"].values()
    assert len(fabric["run"]) == 4
    assert drawn["same_scales"]
    assert np.array_equal(mesh["run"][1], fabric["run"][1])


def test_a_fit_of_three_specimens_has_samples(tmp_path):
    """The laws of the specimens are in the file of the fabric."""
    files, out = shear_files(tmp_path), tmp_path / "fit"
    words = ["--width 100 --height 250", "--law sin2", "--out", out]
    fit("bias-extension", *files, *words)
    found = read_fabric(out / "fabric.json")
    assert len(found.origin.specimens["shear"]) == 3
    stiffnesses = [one.law.stiffness for one in found.origin.specimens["shear"]]
    drawn = [one.shear_law.stiffness for one in found.samples(30)]
    assert min(drawn) < min(stiffnesses) < max(stiffnesses) < max(drawn)


def test_the_origin_of_a_fit_names_its_specimens():
    from skfem_textile import Sin2
    from skfem_textile.calibration import BiasExtension

    test, gamma = BiasExtension(100.0, 250.0), np.radians(np.arange(1.0, 40.0))
    tests = [
        Specimen(name, test, test.force(Sin2(G), gamma), test.displacement(gamma))
        for name, G in (("a", 0.3), ("b", 0.4))
    ]
    origin = fit_tests(tests, Choice("sin2")).origin()
    laws = {one.name: one.law.stiffness for one in origin.specimens["shear"]}
    assert laws == pytest.approx({"a": 0.3, "b": 0.4})
    assert origin.ranges["shear"] == pytest.approx(gamma[-1])


NAMED = "--fabric cao2008-plain-weave"

REFUSED = {
    "--samples 3": "--samples requires --fabric",
    "--fabric cao2008 --samples 3": "--fabric cao2008 is neither a file of a fabric",
    "--fabric farrell-woven-nylon --samples 3": "--samples: the scatter between",
    f"{NAMED} --samples 1": "--samples must be an integer >= 2",
    f"{NAMED} --set fabric.seed=2": "fabric.seed requires --samples",
    f"{NAMED} --samples 2 --tolerance 0.1": "requires one mesh, but",
    f"{NAMED} --samples 2 --workers 0": "expected a positive integer",
    "--workers 2": "--workers applies to --samples only",
    "--scheduler x": "--scheduler applies to --samples only",
}


@pytest.mark.parametrize("words", REFUSED)
def test_contradictions_are_refused_before_any_work(
    words, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    line = ["run", "bias_extension", "--out", "out", *words.split()]
    assert REFUSED[words] in rejected(capsys, *line)
    assert not (tmp_path / "out").exists()


def test_a_case_file_names_a_fabric_of_the_catalogue(tmp_path):
    """The results contain a copy of its file."""
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(
        'scene.name = "picture_frame"\nmesh.size = [2, 2]\nstepping.steps = 1\n'
        'fabric.file = "cao2008-balanced-twill"\nfabric.samples = 2\n'
    )
    assert cli.main(["run", str(case), "--no-render", "--out", str(out)]) == 0
    assert summary_in(out)["samples"] == 2
    copy = read_fabric(out / "case_files" / "fabric.json")
    assert copy.origin == read_fabric("cao2008-balanced-twill").origin
    assert json.loads((out / "samples.jsonl").read_text().splitlines()[0])["found"]


def test_show_states_laws_sources_and_assumptions(tmp_path, capsys):
    assert cli.main(["show", "cao2008-plain-weave"]) == 0
    printed = capsys.readouterr().out
    for text in ("95 % band of a further specimen", "Assumed, tension", "Fig. 38"):
        assert text in printed
    assert "115x230 HKUST" in printed
    assumed = [line for line in printed.splitlines() if line.endswith("(assumed)")]
    assert [line.split()[0] for line in assumed] == ["Tension,", "Tension,", "Bending"]
    assert cli.main(["show", "farrell-woven-nylon", "--no-render"]) == 0
    printed = capsys.readouterr().out
    assert "band" not in printed
    assert "61.947)\n" in printed  # measured


def test_a_figure_that_is_prescribed_has_no_band():
    bands = {"same": (1.0, 1 + 3e-10), "other": (1.0, 1 + 3e-9)}
    samples = SimpleNamespace(bands=bands, number=5, stopped=[], probability=0.9)
    summary = with_bands({"first": []}, samples)
    assert [x for x in bands if f"{x}{BAND}" in summary] == ["other"]
