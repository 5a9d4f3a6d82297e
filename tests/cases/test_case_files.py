"""Case files: their keys, rejected content, and the case files written by runs."""

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from skfem_textile import (
    Asymmetric,
    CrimpInterchange,
    CrimpToe,
    Fabric,
    Force,
    Linear,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
    __version__,
)
from skfem_textile.cases import (
    CaseFileError,
    case_from_file,
    case_from_tables,
    declared,
)
from skfem_textile.cases.read import read_tables
from skfem_textile.cases.schema import Bending
from skfem_textile.cases.write import case_text
from skfem_textile.cli import main as cli
from skfem_textile.fabric.directions import FibreDirections, directions_of
from skfem_textile.fabric.files import write_law
from skfem_textile.io import write_directions, write_fabric
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers.command_line import QUICK, computed, rejected
from tests.helpers.specimen import (
    SPECIMEN,
    assert_runs_alike,
    run,
    save_strip,
    summary_of,
    write_case,
)

pytestmark = pytest.mark.usefixtures("no_interval")

# Content of case files: the scene, its laws and regions, and defaults


def test_a_file_describes_a_whole_case(tmp_path):
    case = case_from_file(write_case(tmp_path))
    assert case.scene.name == "specimen"
    assert case.scene.mesh.nelements == 6
    assert list(case.scene.conditions) == ["bottom", "top"]
    assert case.scene.driven == "top"
    assert case.scene.rotation == pytest.approx(np.radians(20))
    law = case.fabric.families[0].tension
    assert law == TensionOnly(CrimpToe(1000, 0.004, 10))
    assert case.fabric.shear_law.domain == pytest.approx((-np.pi / 3, np.pi / 3))
    assert case.formulation.stabilisation == 2
    assert isinstance(case.loads[0], Force)
    assert (case.steps, case.solver, case.pictures) == (2, "superlu", False)


def test_the_written_case_and_the_summary_have_every_default(tmp_path):
    assert cli.main(["run", "strip", *QUICK, "--out", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "case.toml").read_text()
    case = tomllib.loads(text)
    inputs = summary_of(tmp_path / "out")["inputs"]
    assert inputs == {**case, "regions": {}, "version": __version__}
    assert case == {
        "scene": {"name": "strip", "rotate_deg": 0.0},
        "mesh": {
            **{"source": "irregular", "size": [2, 3], "jitter": 0.3, "seed": 1},
            "as_is": False,
        },
        "fabric": {"units": "N mm"},
        "tension": {
            **{"law": "linear", "stiffness_N_per_mm": 1e4},
            **{"compression": "law", "pretension_N_per_mm": 0.0},
        },
        "shear": {
            **{"law": "linear", "stiffness_N_per_mm": 1.0},
            "wrinkling_angle_deg": 90.0,
        },
        "bending": {"warp_N_mm": 0.0, "weft_N_mm": 0.0, "twist_N_mm": 0.0},
        "formulation": {"name": "macro", "cs_N_per_mm": 10.0},
        "loads": {"force_N": {}},
        "stepping": {
            "steps": 3,
            "most_unknowns": 50_000,
            "method": "newton",
            "warn_only": [
                *("work", "stabilisation", "deviation", "corners", "surface", "slack")
            ],
            "solver": "auto",
        },
        "output": {"pictures": False, "calculix": False},
    }
    assert "# tolerance is not given" in text


@pytest.mark.parametrize(
    "scene",
    ["strip", "trellis", "bias_extension", "specimen", "cantilever"],
)
def test_init_writes_the_defaults_of_a_scene(tmp_path, capsys, scene):
    file = tmp_path / "new.toml"
    assert cli.main(["init", str(file), "--scene", scene]) == 0
    text = file.read_text()
    assert max(map(len, text.splitlines())) <= 88
    plain, read = case_from_tables({"scene": {"name": scene}}), case_from_file(file)
    assert read.scene.name == scene
    assert np.array_equal(read.scene.mesh.p, plain.scene.mesh.p)
    assert read.fabric.families[0].tension == plain.fabric.families[0].tension
    capsys.readouterr()
    assert "exists" in rejected(capsys, "init", str(file))
    assert file.read_text() == text


REGIONS = """
[scene]
name = "specimen"
[mesh]
source = "two.vtk"
[tension]
stiffness_N_per_mm = 1000
[regions.patch]
weft_deg = 100
[regions.patch.shear]
law = "sin2"
stiffness_N_per_mm = 7
[stepping]
steps = 1
[output]
pictures = false
"""


def with_region(folder, text=REGIONS):
    """A case file, and its mesh with a region."""
    mesh = rectangle(50, 100, (2, 4), "aligned")
    named = mesh.with_subdomains({"patch": lambda x: x[1] > 60})
    named.save(folder / "two.vtk", encode_cell_data=True, encode_point_data=False)
    return write_case(folder, text)


def shear_moments(case, gamma):
    """The moment of the shear law in the region, and outside it."""
    patch = case.scene.mesh.subdomains["patch"]
    elements = np.array([[patch[0]], [0]])
    return case.fabric.at(elements).shear_law.value(np.full((2, 1), gamma)).ravel()


def test_a_region_has_separate_laws_and_fibres(tmp_path):
    file = with_region(tmp_path)
    expected = [float(law.value(np.array(0.3))) for law in (Sin2(7.0), Linear(0.5))]
    assert shear_moments(case_from_file(file), 0.3) == pytest.approx(expected)
    assert run(file, tmp_path / "a") == 0
    assert_runs_alike(tmp_path / "a", tmp_path / "b")
    assert "the fabric differs" in summary_of(tmp_path / "a")["exact_answer"]


def test_a_region_has_the_defaults_of_its_scene(tmp_path):
    """A region has a table of shear, and the scene a stiffness."""
    old = 'law = "sin2"\nstiffness_N_per_mm = 7\n'
    assert old in REGIONS
    table = 'law = "tables/shear.csv"\ncontinuation = "odd"\n'
    case = case_from_file(with_region(tmp_path, REGIONS.replace(old, table)))
    expected = [0.1, 0.5 * np.radians(30.0)]
    assert shear_moments(case, np.radians(30.0)) == pytest.approx(expected)


FIBRES = """
pretension_N_per_mm = 0.1
[tension.in_compression]
stiffness_N_per_mm = 3
[tension.weft]
law = "tables/tension.csv"
extrapolation = "linear"
compression = "none"
pretension_N_per_mm = 0.2
"""


def test_warp_and_weft_have_separate_laws_and_pretension(tmp_path):
    """On triangles, rotated, and again from the case that the run writes."""
    text = SPECIMEN.replace('compression = "none"', FIBRES)
    text = text.replace("size = [2, 3]", 'source = "delaunay"\nsize = [2, 3]')
    text = text.replace("steps = 2", "steps = 1")
    file = write_case(tmp_path, text)
    (tmp_path / "tables" / "tension.csv").write_text(
        "fibre strain (-),tension (N/mm)\n0,0\n0.01,10\n0.05,100\n"
    )
    warp, weft = (family.tension for family in case_from_file(file).fabric.families)
    both = Asymmetric(CrimpToe(1000, 0.004, 10), Linear(3.0))
    assert warp == Pretensioned(both, 0.1)
    table = Tabulated((0.0, 0.01, 0.05), (0.0, 10.0, 100.0), "linear")
    assert weft == Pretensioned(TensionOnly(table), 0.2)
    assert run(file, tmp_path / "a") == 0
    shutil.rmtree(tmp_path / "tables")
    assert_runs_alike(tmp_path / "a", tmp_path / "b", "curve.csv")


def test_a_case_of_the_user_is_not_replaced(tmp_path, capsys):
    file = write_case(tmp_path).rename(tmp_path / "case.toml")
    message = rejected(capsys, "run", str(file), "--out", str(tmp_path))
    assert "was not written by a run" in message
    assert file.read_text() == SPECIMEN
    assert run(file, tmp_path / "out") == 0
    assert run(tmp_path / "out" / "case.toml", tmp_path / "out") == 0  # in its place


# The case written by a run: a run of it gives the same results


OF_FILES = """
[scene]
name = "bias_extension"
[mesh]
size = [2, 4]
directions = "fibres.csv"
[fabric]
file = "cloth.inp"
thickness_mm = 0.2
[stepping]
steps = 1
solver = "superlu"
[output]
pictures = false
"""


def test_a_run_of_the_written_case_is_bitwise_identical(tmp_path):
    outs = [tmp_path / name for name in ("a", "b")]
    assert run(write_case(tmp_path), outs[0]) == 0
    shutil.rmtree(tmp_path / "tables")  # the results contain a copy
    assert_runs_alike(*outs, "curve.csv")
    first, last = map(summary_of, outs)
    assert [first.pop("inputs"), last.pop("inputs")]
    assert first == last


def test_a_command_line_and_its_written_case_agree(tmp_path):
    """On a mesh of triangles from a file."""
    mesh = save_strip(tmp_path / "strip.msh", "triangles")
    few = f"--mesh {mesh} --steps 1 --no-render --force top=1,0 --solver superlu"
    laws = "--shear-law sin2 --shear-stiffness 1 --formulation one-point"
    computed(tmp_path / "a", "strip", few, laws)
    copied = tmp_path / "a" / "case_files" / "mesh.msh"
    assert copied.read_bytes() == (tmp_path / "strip.msh").read_bytes()
    assert_runs_alike(tmp_path / "a", tmp_path / "b")


def test_the_file_of_a_law_is_copied_beside_the_written_case(tmp_path):
    write_law(Sin2(0.3), tmp_path / "law.json")
    few = "--size 3x4 --steps 2 --no-render"
    computed(tmp_path / "a", "strip", few, f"--shear-law {tmp_path / 'law.json'}")
    (tmp_path / "law.json").unlink()
    assert case_from_file(tmp_path / "a" / "case.toml").fabric.shear_law == Sin2(0.3)
    computed(tmp_path / "a", "strip", few)
    assert not (tmp_path / "a" / "case_files" / "shear.json").exists()


def test_directions_and_fabric_are_read_from_files_beside_the_case(tmp_path):
    """The results contain copies of them beside their case."""
    scene = bias_extension(size=(2, 4))
    fabric = Fabric(warp=scene.warp, weft=scene.weft)
    field = directions_of(scene.mesh, fabric)
    turned = FibreDirections.of_angles(*(angle + 5 for angle in field.angles_deg()))
    inputs = tmp_path / "inputs"
    inputs.mkdir()
    write_directions(inputs / "fibres.csv", scene.mesh, turned)
    write_fabric(inputs / "cloth.inp", Fabric(1e5, Sin2(0.3)), 0.2)
    (inputs / "one.toml").write_text(OF_FILES)
    assert run(inputs / "one.toml", tmp_path / "a") == 0
    law, gamma = case_from_file(inputs / "one.toml").fabric.shear_law, np.array([0.5])
    assert law.value(gamma) == pytest.approx(Sin2(0.3).value(gamma), rel=1e-4)
    shutil.rmtree(inputs)
    assert_runs_alike(tmp_path / "a", tmp_path / "b", "fibres.csv")
    text = (tmp_path / "a" / "case.toml").read_text()
    assert "[tension]" not in text
    fabric = {"file": "case_files/fabric.inp", "thickness_mm": 0.2, "units": "N mm"}
    assert tomllib.loads(text)["fabric"] == fabric


def test_a_bending_table_of_a_region_takes_missing_values_from_the_scene():
    region = {"A": {"bending": {"twist_N_mm": 0.5}}}
    file = declared({"scene": {"name": "cantilever"}, "regions": region})
    expected = Bending(warp_N_mm=6.0, weft_N_mm=6.0, twist_N_mm=0.5)
    assert file.regions["A"].bending == expected


#: Results of the case files in the folder of these results.
EARLIER = Path(__file__).parent / "earlier_cases"
RESULTS = json.loads((EARLIER / "results.json").read_text())


@pytest.mark.parametrize("name", RESULTS)
def test_a_file_of_an_earlier_run_gives_the_same_results(name):
    """Bit for bit on the machine that wrote them, on a mesh that is not fitted."""
    tables = tomllib.loads((EARLIER / f"{name}.toml").read_text())
    tables["mesh"]["as_is"] = tables["scene"]["name"] != "hemisphere"
    case = case_from_tables(tables)
    summary, expected = case.summary(case.run()), RESULTS[name]
    for key, value in expected.items():
        assert summary[key] == pytest.approx(value, rel=1e-9, abs=1e-9), key


def test_every_file_runs():
    assert {file.stem for file in EARLIER.glob("*.toml")} == set(RESULTS)


NO_COMPRESSION = 'compression = "none"'
IN_COMPRESSION = "[fabric.in_compression]\nstiffness_N_per_mm = 3"
FITTED = '[scene]\nname = "strip"\n[fabric]\nfile = "fabric.json"\n'


def tension_of_file(folder, fabric, keys):
    """Tension laws of a case with a fabric of a file."""
    write_fabric(folder / "fabric.json", fabric)
    families = case_from_file(write_case(folder, FITTED + keys)).fabric.families
    return [family.tension for family in families]


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        (NO_COMPRESSION, TensionOnly(Linear(1e4))),
        (IN_COMPRESSION, Asymmetric(Linear(1e4), Linear(3.0))),
    ],
)
def test_a_case_adds_a_law_in_compression_to_a_fabric_of_a_file(
    tmp_path, keys, expected
):
    assert tension_of_file(tmp_path, Fabric(1e4, 0.1), keys) == [expected] * 2
    tensed = Fabric(Pretensioned(Linear(1e4), 0.5), 0.1)
    warp, _ = tension_of_file(tmp_path, tensed, keys)
    assert warp == Pretensioned(expected, 0.5)
    file = declared(tomllib.loads(FITTED + keys), tmp_path)
    (tmp_path / "again.toml").write_text(case_text(file, "# again"))
    again = case_from_file(tmp_path / "again.toml").fabric.families
    assert again[0].tension == warp


@pytest.mark.parametrize(
    ("tension", "keys", "text"),
    [
        (TensionOnly(Linear(1e4)), NO_COMPRESSION, "already contains a law"),
        (
            CrimpInterchange(1e4, 0.01, 1.0, 1e-3, 1.0),
            *(NO_COMPRESSION, "tension law of both strains"),
        ),
        (
            Linear(1e4),
            f"{NO_COMPRESSION}\n{IN_COMPRESSION}",
            "compression is 'none', but in_compression is a law: omit one",
        ),
        (Linear(1e4), f"[tension]\n{NO_COMPRESSION}", "fabric.in_compression add"),
    ],
)
def test_two_statements_about_compression_are_refused(tmp_path, tension, keys, text):
    with pytest.raises(CaseFileError, match=text):
        tension_of_file(tmp_path, Fabric(tension, 0.1), keys)


def test_a_law_in_compression_requires_a_fabric_of_a_file():
    tables = {"scene": {"name": "strip"}, "fabric": {"compression": "none"}}
    with pytest.raises(CaseFileError, match="requires fabric"):
        case_from_tables(tables)


def test_a_case_file_contains_at_most_a_million_bytes(tmp_path):
    file, head = tmp_path / "case.toml", b'[scene]\nname = "strip"\n#'
    file.write_bytes(head.ljust(1_000_000, b"-"))
    assert read_tables(file) == {"scene": {"name": "strip"}}
    file.write_bytes(head.ljust(1_000_001, b"-"))
    with pytest.raises(CaseFileError, match="at most 1000000 bytes"):
        read_tables(file)
