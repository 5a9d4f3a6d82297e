"""What is wrong with a case file is told in one line of its words."""

import pytest

from skfem_textile.cases import CaseFileError, case_from_tables
from tests.helpers.command_line import refused
from tests.helpers.specimen import SPECIMEN, run, written


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("steps = 2", "stepz = 2", "stepping has no key 'stepz'; the nearest is 'ste"),
        ("[stepping]", "[steping]", "there is no table 'steping'; the nearest is 'st"),
        ("steps = 2", "steps = 2.5", "stepping.steps must be int, got float"),
        ("steps = 2", "steps = '2'", "stepping.steps must be int, got str"),
        ("steps = 2", "steps = 0", "steps must be at least 1"),
        ("steps = 2", "steps", "no TOML: "),
        ("stiffness_N_per_mm", "stiffness", "the nearest is 'stiffness_N_per_mm'"),
        ("stiffness_N_per_mm", "stiffness_kN_per_m", "nearest is 'stiffness_N_per_"),
        ("height_mm = 110", "height_cm = 11", "the nearest is 'height_mm'"),
        (
            "height_mm = 110",
            "height_mm = nan",
            "scene.height_mm must be a finite number, got nan",
        ),
        (
            "rotate_deg = 20",
            "rotate_deg = inf",
            "scene.rotate_deg must be a finite number",
        ),
        (
            "rotate_deg = 20",
            "bend_deg = 20",
            "scene.bend_deg goes with scene.name trellis",
        ),
        ('"specimen"', '"speciment"', "scene.name is 'speciment': it must be one of"),
        ("[shear]", "[tension.weft]\ntoe = 1\n[shear]", "tension.weft.toe goes with"),
        ("[shear]", "[tension.wefd]\n[shear]", "'wefd'; the nearest is 'weft'"),
        ("[shear]", "[tension.in_compression]\n[shear]", "in_compression is a law: le"),
        ("[shear]", "[tension.weft.weft]\n[shear]", "tension.weft has no key 'weft'"),
        (
            'compression = "none"',
            "pretension_N_per_mm = -1",
            "tension pretension must be a finite number >= 0",
        ),
        ("toe = 0.004\n", "", "tension.toe is missing"),
        ("toe = 0.004", "toe = -1", "toe must be a finite number > 0, got -1.0"),
        ('"crimp-toe"', '"linear"', "tension.toe goes with tension.law crimp-"),
        (
            '"crimp-toe"',
            '"crimp"',
            "tension.law is 'crimp', which is none of linear, F",
        ),
        ("tables/shear", "shear", "shear.law "),
        (
            '"odd"',
            '"old"',
            "'old', which is none of none, odd; the nearest is 'odd'",
        ),
        ('"one-point"', '"full"', "formulation.cs_N_per_mm goes with formulation.name"),
        (
            "cs_N_per_mm = 2",
            "cs_N_per_mm = 'aut'",
            "is 'aut', which is none of a number, auto",
        ),
        (
            '["free", 12]',
            '["fre", 12]',
            "scene.move_mm is 'fre', which is none of a number, f",
        ),
        ('["free", 12]', "[12]", "scene.move_mm"),
        ("top = ", "lid = ", "the mesh has no boundary 'lid'"),
        (
            "right = [0.5, 0]",
            "right = [inf, 0]",
            "loads.force_N.right must be a finite number",
        ),
        ("size = [3, 7]", "source = 'x.msh'", "neither a file nor one of aligned"),
        ("size = [3, 7]", "size = [3]", "mesh.size must be array of length 2, got 1"),
        ("size = [3, 7]", "size = 1979-05-27", "mesh.size must be array, got date"),
        ('solver = "superlu"', 'solver = "supreme"', "which is none of auto, cholmod"),
        (
            "[loads.force_N]",
            "[loads]\nforce_N = 1\n[x]",
            "loads.force_N must be a table, got int",
        ),
        ("[shear]", "[regions.patch]\n[shear]", "no subdomain 'patch' (it has: none)"),
        (
            "[shear]",
            "[regions.a]\n[fabric]\nfile = 'a.inp'\n[shear]",
            "[tension] has a law, but fabric.file",
        ),
        (
            "[shear]",
            "[fabric]\nunits = 'N m'\n[shear]",
            "units and material go with fabric.file",
        ),
        (
            "[shear]",
            "[fabric]\nfile = 'a.inp'\n[shear]",
            "[tension] has a law, but fabric.file",
        ),
        ("[mesh]", "[mesh]\ndirections = 'a.csv'", "a.csv"),
        ("[shear]", "[regions.a.tensio]\n[shear]", "regions.a has no key 'tensio'"),
    ],
)
def test_what_is_wrong_with_a_file_is_told_in_one_line_of_its_words(
    tmp_path, capsys, old, new, message
):
    assert old in SPECIMEN
    file = written(tmp_path, SPECIMEN.replace(old, new))
    said = refused(capsys, "run", str(file), "--out", str(tmp_path / "out"))
    assert message in said
    assert "one.toml: " in said
    assert "--" not in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\xff", "no text in UTF-8"),
        (b"x = " + b"[" * 100_000, "too deeply"),
        (b"#" * 1_000_001, "more than 1000000 bytes"),
        (b"", "scene.name is missing: it must be one of strip"),
        (b"scene = 3", "scene must be a table, not 3"),
        (b"[scene]\nname = 'strip'\n[stepping]\nsteps = " + b"9" * 5000, "no TOML"),
    ],
)
def test_a_file_that_is_no_case_is_refused(tmp_path, capsys, content, message):
    file = tmp_path / "bad.TOML"
    file.write_bytes(content)
    assert message in refused(capsys, "run", str(file), "--out", str(tmp_path / "o"))


def test_a_file_that_is_not_there_is_refused(tmp_path, capsys):
    out = ("--out", str(tmp_path / "out"))
    assert "no.toml" in refused(capsys, "run", str(tmp_path / "no.toml"), *out)
    (tmp_path / "folder.toml").mkdir()
    assert "folder.toml" in refused(capsys, "run", str(tmp_path / "folder.toml"), *out)
    assert "must end with .toml" in refused(capsys, "init", str(tmp_path / "x.txt"))


def test_a_case_of_the_user_is_not_replaced(tmp_path, capsys):
    file = written(tmp_path).rename(tmp_path / "case.toml")
    said = refused(capsys, "run", str(file), "--out", str(tmp_path))
    assert "was not written by a run" in said
    assert file.read_text() == SPECIMEN
    assert run(file, tmp_path / "out") == 0
    assert run(tmp_path / "out" / "case.toml", tmp_path / "out") == 0  # in its place


def test_functions_are_refused(tmp_path):
    tables = {"scene": {"name": "strip"}, "shear": {"law": lambda x: x}}
    with pytest.raises(CaseFileError, match=r"shear\.law is a function, which a case"):
        case_from_tables(tables)
