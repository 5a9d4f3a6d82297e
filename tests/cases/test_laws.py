"""Laws of the command line: by name with their parameters, and from CSV files."""

import numpy as np
import pytest

from skfem_textile import Bilinear, Fabric, Linear, TensionOnly, WithFriction
from skfem_textile.cases import case_from_tables
from skfem_textile.io import write_fabric
from tests.helpers.command_line import computed, rejected, run

pytestmark = pytest.mark.usefixtures("no_interval")

# Without a shear stiffness, which contradicts some shear laws.
QUICK = "--size 2x2 --steps 1 --no-render --set formulation.cs_N_per_mm=10"

SHEAR = "shear angle (deg),moment (N mm/mm2)\n"
TENSION = "fibre strain (-),tension (N/mm)\n"
TOE = "--set tension.toe=0.004 tension.initial_stiffness_N_per_mm=100"
CRIMPED = f"--tension-law crimp-interchange {TOE} tension.bending_N_per_mm=1"
SINE = "--shear-law polynomial --set shear.coefficients_N_per_mm=[0.5]"


@pytest.fixture(scope="module")
def of_law(tmp_path_factory):
    """Summary of a strip, which reaches 62.5 degrees, with a law; computed once."""
    computed_before = {}

    def of(*options):
        if options not in computed_before:
            out = tmp_path_factory.mktemp("law")
            computed_before[options] = computed(out, "strip", QUICK, *options)
        return computed_before[options]

    return of


FRICTION = "--set shear.friction.limits_N_per_mm=0.02,0.05 shear.friction"
LINEAR = "--shear-stiffness 0.5"
TWICE = SINE.replace("[0.5]", "0.5,0.0")


def table(folder, name, text):
    (folder / name).write_text(text)
    return str(folder / name)


def test_tables_of_linear_laws_give_the_answer_of_the_linear_laws(tmp_path, of_law):
    linear = of_law("--shear-stiffness 0.5 --fibre-stiffness 2e3")
    radian = 57.29577951308232
    angles = "".join(f"{n * radian / 4!r},{n / 8}\n" for n in range(7))
    strains = "".join(f"{n / 10},{200 * n}\n" for n in range(-5, 6))
    shear = table(tmp_path, "shear.csv", SHEAR + angles)
    tension = table(tmp_path, "tension.CSV", TENSION + strains)
    laws = f"--shear-law {shear} --tension-law {tension}"
    found = of_law(laws, "--set shear.continuation=odd")
    assert found["inputs"]["shear"]["law"] == shear
    for key in ("energy", "reaction_x", "reaction_y", "max_fibre_tension"):
        assert found[key] == pytest.approx(linear[key], rel=1e-9)


@pytest.mark.parametrize(
    ("law", "key", "other", "low", "high"),
    [
        # M = 0.5 Γ by a polynomial
        (SINE, "energy", LINEAR, 0.999, 1.001),
        (f"{TWICE} shear.continuation=odd", "energy", LINEAR, 0.999, 1.001),
        (f"{SINE} shear.variable=sine", "shear_energy", SINE, 0.5, 0.96),
        # a locking law in degrees: 1.9 times the moment at 62.5 degrees
        (
            f"--shear-law locking {LINEAR} --set shear.locking_angle_deg=90",
            *("shear_energy", LINEAR, 1.1, 1.9),
        ),
        (
            f"{LINEAR} --tension-law crimp-toe {TOE}",
            *("max_fibre_strain", LINEAR, 50.0, 150.0),
        ),
        # an interchange is a toe without crimp, and softer with it
        (
            f"{CRIMPED} tension.warp_crimp=0 tension.weft_crimp=0",
            *("energy", f"--tension-law crimp-toe {TOE}", 1 - 1e-9, 1 + 1e-9),
        ),
        (
            f"{CRIMPED} tension.warp_crimp=0.01 tension.weft_crimp=0",
            *("energy", f"--tension-law crimp-toe {TOE}", 0.0, 0.99),
        ),
    ],
)
def test_a_law_by_name_has_its_parameters(of_law, law, key, other, low, high):
    """A quantity, in proportion to that with another law."""
    assert low < of_law(law)[key] / of_law(other)[key] < high


def test_a_table_is_extrapolated_with_one_warning_on_request(tmp_path, capsys):
    file = table(tmp_path, "law.csv", SHEAR + "0,0\n20,0.2\n40,0.5\n")
    options = "--set shear.continuation=odd shear.extrapolation=linear"
    computed(tmp_path, "strip", QUICK, "--shear-law", file, options)
    assert capsys.readouterr().err.count("extrapolated linearly") == 1


def test_a_checkpoint_distinguishes_tables_by_their_points(tmp_path, capsys):
    folder = str(tmp_path / "c")
    file = table(tmp_path, "law.csv", SHEAR + "0,0\n90,1\n")
    law = f"{QUICK} --shear-law {file} --set shear.continuation=odd".split()
    assert run(tmp_path, *law, "--checkpoint", folder) == 0
    assert run(tmp_path, *law, "--resume", folder) == 0
    table(tmp_path, "law.csv", SHEAR + "0,0\n90,1.01\n")
    capsys.readouterr()
    command = ("run", "strip", "--out", str(tmp_path / "new"), *law)
    message = rejected(capsys, *command, "--resume", folder)
    assert "belongs to another run: shear law was Tabulated(" in message


def test_no_exact_solution_is_given_for_an_angle_beyond_a_pole(tmp_path):
    """Fibres stretch before they reach the pole; 40 degrees are not reached."""
    law = "--shear-law locking --set shear.locking_angle_deg=35"
    few = "--size 2x2 --steps 1 --no-render"
    summary = computed(tmp_path, "bias_extension", few, law)
    assert summary["exact_answer"].startswith("none: for inextensible fibres")
    assert "load_over_exact" not in summary


# Friction, programmes and conditions that end


def test_a_case_file_has_friction_for_each_law(tmp_path):
    tables = {
        "scene": {"name": "picture_frame"},
        "shear": {
            "law": "linear",
            "stiffness_N_per_mm": 0.5,
            "friction": {"limits_N_per_mm": [0.02, 0.05], "onsets_deg": [1, 8]},
        },
        "tension": {
            "law": "linear",
            "stiffness_N_per_mm": 1e4,
            "compression": "none",
            "friction": {"limits_N_per_mm": [5.0], "onsets": [0.001]},
            "weft": {"law": "linear", "stiffness_N_per_mm": 2e4},
        },
    }
    fabric = case_from_tables(tables).fabric
    onsets = np.radians([1.0, 8.0])
    assert fabric.shear_law == WithFriction(Linear(0.5), [0.02, 0.05], onsets)
    warp, weft = fabric.tensions.laws
    assert warp == WithFriction(TensionOnly(Linear(1e4)), [5.0], [0.001])
    assert weft == Linear(2e4)
    write_fabric(tmp_path / "fabric.json", fabric)
    again = {"scene": tables["scene"], "fabric": {"file": "fabric.json"}}
    assert case_from_tables(again, tmp_path).fabric.laws == fabric.laws


def test_a_law_of_a_file_has_its_friction_without_force_in_compression(tmp_path):
    friction = [5.0], [0.001]
    fabric = Fabric(WithFriction(Linear(1e4), *friction), 0.5)
    write_fabric(tmp_path / "fabric.json", fabric)
    table = {"file": "fabric.json", "compression": "none"}
    tables = {"scene": {"name": "picture_frame"}, "fabric": table}
    for family in case_from_tables(tables, tmp_path).fabric.families:
        assert family.tension == WithFriction(TensionOnly(Linear(1e4)), *friction)


def test_a_bending_law_has_friction_in_a_case_file():
    law = {"law": "bilinear", "stiffness_N_mm": 6.0, "knee_per_mm": 0.01}
    friction = {"limits_N": [0.02], "onsets_per_mm": [0.002]}
    law |= {"further_stiffness_N_mm": 2.0, "friction": friction}
    tables = {"scene": {"name": "cantilever"}, "bending": {"warp_law": law}}
    warp, _ = case_from_tables(tables).fabric.bending
    assert warp == WithFriction(Bilinear(6.0, 0.01, 2.0), [0.02], [0.002])


def test_a_programme_and_a_release_are_parts_of_equal_steps(tmp_path):
    options = "--across circle --programme 1 0.5 --release top --no-render"
    size = "--size 2x2 --steps 2 --set formulation.name=full"
    friction = f"{FRICTION}.onsets_deg=1,8"
    summary = computed(tmp_path, "simple_shear", size, options, friction)
    assert summary["load_steps"] == 3 * 2 + 1  # and the state after the end
    assert summary["inputs"]["stepping"]["programme"] == [1.0, 0.5]
    assert summary["energy_lost"] == summary["shear_energy_lost"] > 0
    assert abs(summary["load_N"]) < 1e-6
    assert 1.0 < summary["max_shear_angle_deg"] < 10.0


@pytest.mark.parametrize(
    ("scene", "options", "message"),
    [
        (
            "strip",
            f"{FRICTION}.onsets_deg=[1]",
            "shear friction requires a limit and an",
        ),
        ("strip", f"{FRICTION}.onsets_deg=1,-8", "shear onset must be a finite number"),
        ("strip", f"{FRICTION}.onsets=1,8", "shear.friction has no key 'onsets'"),
        ("hemisphere", "--programme 1 0", "--programme: a programme does not apply"),
        (
            "strip",
            "--release edge",
            "--release: the scene strip has no condition 'edge'",
        ),
        ("simple_shear", "--release top bottom", "--release: no condition remains"),
        (
            "bias_extension",
            f"--tolerance 0.1 {FRICTION}.onsets_deg=1,8",
            "a tolerance requires laws and tools without friction",
        ),
        (
            "hemisphere_forming",
            "--tolerance 0.1 --set scene.friction=0.1",
            "a tolerance requires laws and tools without friction",
        ),
    ],
)
def test_contradicting_options_are_refused(scene, options, message, tmp_path, capsys):
    out = "--out", str(tmp_path / "out"), "--no-render"
    assert message in rejected(capsys, "run", scene, *out, *options.split())


# Bending laws

BEND = "--size 4x1 --steps 1 --no-render --set mesh.jitter=0"
KNEE = "bending.warp_law.knee_per_mm=1e-3 bending.warp_law.further_stiffness_N_mm=2"
BILINEAR = f"bending.warp_law.law=bilinear bending.warp_law.stiffness_N_mm=6 {KNEE}"


@pytest.mark.slow
def test_a_bending_law_of_a_file_or_with_its_numbers(tmp_path):
    moments = "curvature (1/m),moment (N)\n0,0\n100,0.6\n"
    file = table(tmp_path, "moments.csv", moments)
    of_file = f"bending.warp_law.law={file} bending.warp_law.continuation=odd"
    drops = [
        computed(tmp_path / str(i), "cantilever", f"{BEND} {law}")["tip_z_mm"]
        for i, law in enumerate(("bending.warp_N_mm=6", of_file, BILINEAR))
    ]
    assert drops[1] == pytest.approx(drops[0], rel=1e-9)
    assert drops[2] < 1.2 * drops[0]  # softer: further down
    case = (tmp_path / "2" / "case.toml").read_text()
    assert "[bending.warp_law]" in case
    again = computed(tmp_path / "again", str(tmp_path / "2" / "case.toml"), "")
    assert again["tip_z_mm"] == pytest.approx(drops[2], rel=1e-12)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (
            "bending.warp_law.law=linear",
            "expected one of bilinear, FILE.csv, FILE.json",
        ),
        (f"bending.warp_N_mm=3 {BILINEAR}", "warp_law is a law: omit one of them"),
    ],
)
def test_contradictory_bending_laws_are_refused(law, message, tmp_path, capsys):
    words = f"--out {tmp_path / 'out'} {BEND} {law}".split()
    assert message in rejected(capsys, "run", "cantilever", *words)
