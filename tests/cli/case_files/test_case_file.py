"""What a case file says: the scene, its laws and regions, and what is left out."""

import shutil
import tomllib

import numpy as np
import pytest

from skfem_textile import (
    Asymmetric,
    CrimpToe,
    Force,
    Linear,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
)
from skfem_textile.cases import case_from_file, case_from_tables
from skfem_textile.cli import main as cli
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers.command_line import QUICK, refused
from tests.helpers.specimen import (
    SHEAR,
    SPECIMEN,
    assert_runs_alike,
    run,
    summary_of,
    written,
)


def test_a_file_says_all_that_a_case_has(tmp_path):
    case = case_from_file(written(tmp_path))
    assert case.scene.name == "specimen"
    assert case.scene.mesh.nelements == 21
    assert list(case.scene.conditions) == ["bottom", "top"]
    assert case.scene.driven == "top"
    assert case.scene.rotation == pytest.approx(np.radians(20))
    law = case.fabric.families[0].tension
    assert law == TensionOnly(CrimpToe(1000, 0.004, 10))
    assert case.fabric.shear_law.domain == pytest.approx((-np.pi / 3, np.pi / 3))
    assert case.formulation.stabilisation == 2
    assert isinstance(case.loads[0], Force)
    assert (case.steps, case.solver, case.pictures) == (2, "superlu", False)


def test_the_written_case_has_every_default(tmp_path):
    assert cli.main(["run", "strip", *QUICK, "--out", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "case.toml").read_text()
    assert tomllib.loads(text) == {
        "scene": {"name": "strip", "rotate_deg": 0.0},
        "mesh": {"source": "irregular", "size": [3, 4], "jitter": 0.3, "seed": 1},
        "fabric": {"units": "N mm"},
        "tension": {
            "law": "linear",
            "stiffness_N_per_mm": 1e4,
            "compression": "law",
            "pretension_N_per_mm": 0.0,
        },
        "shear": {
            "law": "linear",
            "stiffness_N_per_mm": 1.0,
            "wrinkling_angle_deg": 90.0,
        },
        "bending": {"warp_N_mm": 0.0, "weft_N_mm": 0.0, "twist_N_mm": 0.0},
        "formulation": {"name": "macro", "cs_N_per_mm": 10.0},
        "loads": {"force_N": {}},
        "stepping": {
            "steps": 3,
            "most_unknowns": 50_000,
            "method": "newton",
            "warn_only": ["work", "stabilisation", "deviation", "corners", "surface"],
            "solver": "auto",
        },
        "output": {"pictures": False},
    }
    assert "# tolerance is not given" in text


@pytest.mark.parametrize(
    "scene",
    [
        *("strip", "picture_frame", "trellis", "bias_extension", "specimen"),
        *("cantilever", "buckling"),
    ],
)
def test_init_writes_the_defaults_of_a_scene(tmp_path, capsys, scene):
    file = tmp_path / "new.toml"
    assert cli.main(["init", str(file), "--scene", scene]) == 0
    text = file.read_text()
    assert max(map(len, text.splitlines())) <= 88
    plain, said = case_from_tables({"scene": {"name": scene}}), case_from_file(file)
    assert said.scene.name == scene
    assert np.array_equal(said.scene.mesh.p, plain.scene.mesh.p)
    assert said.fabric.families[0].tension == plain.fabric.families[0].tension
    capsys.readouterr()
    assert "exists" in refused(capsys, "init", str(file))
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


def test_a_region_has_laws_and_fibres_of_its_own(tmp_path):
    mesh = rectangle(50, 100, (4, 8), "aligned")
    file = tmp_path / "regions.toml"
    file.write_text(REGIONS)
    named = mesh.with_subdomains({"patch": lambda x: x[1] > 60})
    named.save(tmp_path / "two.vtk", encode_cell_data=True, encode_point_data=False)
    case = case_from_file(file)
    patch = case.scene.mesh.subdomains["patch"]
    laws = [case.fabric.at(np.array([[i]])).shear_law for i in (patch[0], 0)]
    gamma = np.array([[0.3]])
    values = [float(law.value(gamma)[0, 0]) for law in (Sin2(7.0), Linear(0.5))]
    assert [float(law.value(gamma)[0, 0]) for law in laws] == pytest.approx(values)
    assert run(file, tmp_path / "a") == 0
    assert_runs_alike(tmp_path / "a", tmp_path / "b")
    assert "the fabric differs" in summary_of(tmp_path / "a")["exact_answer"]


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


def test_warp_and_weft_have_laws_of_their_own_and_pretension(tmp_path):
    """On triangles, rotated, and again from the case that the run leaves."""
    text = SPECIMEN.replace('compression = "none"', FIBRES)
    text = text.replace("size = [3, 7]", 'source = "delaunay"\nsize = [3, 7]')
    file = written(tmp_path, text)
    (tmp_path / "tables" / "tension.csv").write_text(
        "fibre strain (-),tension (N/mm)\n0,0\n0.01,10\n0.05,100\n"
    )
    fabric = case_from_file(file).fabric
    crimped = CrimpToe(1000, 0.004, 10)
    assert fabric.families[0].tension == Pretensioned(
        Asymmetric(crimped, Linear(3.0)), 0.1
    )
    table = Tabulated((0.0, 0.01, 0.05), (0.0, 10.0, 100.0), "linear")
    assert fabric.families[1].tension == Pretensioned(TensionOnly(table), 0.2)
    assert run(file, tmp_path / "a") == 0
    shutil.rmtree(tmp_path / "tables")
    assert_runs_alike(tmp_path / "a", tmp_path / "b", "curve.csv")


def test_a_region_has_the_defaults_of_its_scene(tmp_path):
    """A table of shear in a region, where the scene has a stiffness of its own."""
    mesh = rectangle(50, 100, (4, 8), "aligned")
    named = mesh.with_subdomains({"patch": lambda x: x[1] > 60})
    named.save(tmp_path / "two.vtk", encode_cell_data=True, encode_point_data=False)
    (tmp_path / "shear.csv").write_text(SHEAR)
    file = tmp_path / "regions.toml"
    old = 'law = "sin2"\nstiffness_N_per_mm = 7\n'
    assert old in REGIONS
    file.write_text(REGIONS.replace(old, 'law = "shear.csv"\ncontinuation = "odd"\n'))
    case = case_from_file(file)
    patch = case.scene.mesh.subdomains["patch"]
    law = case.fabric.at(np.array([[patch[0]]])).shear_law
    assert law.value(np.radians([[30.0]])) == pytest.approx(0.1)
