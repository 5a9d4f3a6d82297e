"""The commands, and how bad input, signals and odd words are answered."""

import pytest

from skfem_textile.cli import main as cli
from tests.helpers.command_line import QUICK, refused


def test_list_names_the_scenes(capsys):
    assert cli.main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [
        *("strip", "picture_frame", "trellis", "bias_extension", "specimen"),
        *("cantilever", "buckling"),
        *("hemisphere", "cylinder", "double_dome", "saddle", "drape"),
    ]
    assert [line.split()[0] for line in lines] == names


def test_an_unknown_scene_is_refused(tmp_path, capsys):
    error = refused(capsys, "run", "stripe", "--out", str(tmp_path))
    assert "'stripe'" in error
    assert "strip" in error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--set", "formulation.cs_N_per_mm=-1"), "stabilisation must be"),
        (("--set", "formulation.cs_N_per_mm=much"), "which is none of a number, auto"),
        (("--shear-law", "sin2", "--shear-stiffness", "-1"), "shear stiffness must be"),
        (("--fibre-stiffness", "-5"), "tension stiffness must be"),
        (("--fibre-stiffness", "0"), "no stiffness"),
        (("--shear-stiffness", "nan"), "must be a finite number, got nan"),
        (("--steps", "0"), "steps must be at least 1"),
        (("--steps", "99999999999999999999999"), "no more than 1000000; got 9999999"),
        (("--size", "10"), "'10' is not like 10x15"),
        (("--size", "0x5"), "at least 1x1"),
        (("--size", "1000000x1000000"), "llocate"),
        (("--set", "mesh.jitter=2"), "jitter must be in"),
        (("--set", "mesh.seed=-1"), "seed must be"),
        (("--rotate", "nan"), "scene.rotate_deg must be a finite number"),
        (("--rotate", "1e17"), "scene.rotate_deg must be float <= 36000.0"),
        (("--mesh", "curly"), "mesh.source curly: neither a file nor one of aligned"),
        (("--formulation", "fuller"), "--formulation"),
        (("--set", "formulation.stabilisation=magic"), "goes with"),
        (("--set", "stepping.method=magic"), "'magic', which is none of"),
        (("--set", "stepping.warn_only=['magic']"), "stepping.warn_only is 'magic'"),
        (("--set", "stepping.methods=newton"), "the nearest is 'method'"),
        (("--set", "steps=4"), "'steps=4' is not like stepping.steps=5"),
        (("--set", "scene.name.x=4"), "name is a value, not a table"),
        (("--set", "mesh.size=3"), "mesh.size must be array, got int"),
    ],
)
def test_bad_input_is_refused_before_anything_is_written(
    tmp_path, capsys, arguments, message
):
    out = str(tmp_path / "out")
    error = refused(capsys, "run", "strip", "--out", out, "--no-render", *arguments)
    assert message in error
    assert list(tmp_path.iterdir()) == []


def test_numbers_that_make_no_sense_are_refused(capsys, tmp_path):
    out = ("--out", str(tmp_path / "o"))
    said = refused(capsys, "run", "trellis", "--fibres", "nan", *out)
    assert "scene.warp_deg must be a finite number" in said


def test_of_a_long_line_the_middle_is_left_out(tmp_path, capsys):
    out = ("--out", str(tmp_path / "o"))
    said = refused(capsys, "run", "strip", *out, "--size", "9" * 5000)
    assert len(said) < 500
    assert "argument --size: '999" in said
    assert " ... " in said
    assert said.endswith("' is not like 10x15\n")


@pytest.mark.parametrize("word", ["--size=--", "--out=--"])
def test_two_dashes_are_no_value(tmp_path, capsys, word):
    said = refused(capsys, "run", "strip", "--out", str(tmp_path), word, *QUICK)
    assert "is no value" in said


def test_what_looks_like_an_option_is_no_folder(tmp_path, capsys):
    out = ["--out", str(tmp_path / "out")]
    said = refused(capsys, "run", "strip", *QUICK, *out, "--resume", "--paper x")
    assert "'--paper x' is no option" in said


@pytest.mark.parametrize("option", ["--out", "--checkpoint", "--resume"])
def test_a_folder_without_a_name_is_refused(tmp_path, capsys, monkeypatch, option):
    monkeypatch.chdir(tmp_path)
    said = refused(capsys, "run", "strip", *QUICK, "--out", "o", option, "")
    assert f"argument {option}: a folder must have a name" in said
    assert list(tmp_path.iterdir()) == []
