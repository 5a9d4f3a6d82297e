"""Laws of the command line: by name with their parameters, and from CSV files."""

import json

import pytest

from skfem_textile.cli import main as cli
from tests.helpers.command_line import rejected, run

pytestmark = pytest.mark.usefixtures("no_interval")

# Without a shear stiffness, which contradicts some shear laws.
QUICK = [
    "--size",
    "3x4",
    "--steps",
    "3",
    "--set",
    "formulation.cs_N_per_mm=10",
    "--no-render",
]

SHEAR = "shear angle (deg),moment (N mm/mm2)\n"
TENSION = "fibre strain (-),tension (N/mm)\n"


def summary(tmp_path, *arguments):
    assert run(tmp_path, *QUICK, *arguments) == 0
    return json.loads((tmp_path / "out" / "summary.json").read_text())


@pytest.fixture(scope="module")
def linear(tmp_path_factory):
    """Summary with the linear shear law."""
    return summary(tmp_path_factory.mktemp("linear"), "--shear-stiffness", "0.5")


def write_table(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    return str(tmp_path / name)


def test_tables_of_linear_laws_give_the_answer_of_the_linear_laws(tmp_path):
    """The strip reaches 62.5 degrees; reactions agree to 1e-9."""
    linear = summary(tmp_path, "--shear-stiffness", "0.5", "--fibre-stiffness", "2e3")
    radian = 57.29577951308232
    angles = "".join(f"{n * radian / 4!r},{n / 8}\n" for n in range(7))
    strains = "".join(f"{n / 10},{200 * n}\n" for n in range(-5, 6))
    laws = (
        *("--shear-law", write_table(tmp_path, "shear.csv", SHEAR + angles)),
        *("--set", "shear.continuation=odd"),
        *("--tension-law", write_table(tmp_path, "tension.CSV", TENSION + strains)),
    )
    computed = summary(tmp_path, *laws)
    assert computed["inputs"]["shear"]["law"] == laws[1]
    for key in ("energy", "reaction_x", "reaction_y", "max_fibre_tension"):
        assert computed[key] == pytest.approx(linear[key], rel=1e-9)


@pytest.mark.parametrize(
    "law",
    [
        ("--shear-law", "polynomial", "--set", "shear.coefficients_N_per_mm=[0.5]"),
        (
            *(
                "--shear-law",
                "polynomial",
                "--set",
                "shear.coefficients_N_per_mm=0.5,0.0",
            ),
            *("--set", "shear.continuation=odd"),
        ),
    ],
)
def test_a_law_by_name_accepts_its_parameters(tmp_path, linear, law):
    """Each result is close to the linear law."""
    computed = summary(tmp_path, *law)
    assert computed["energy"] == pytest.approx(linear["energy"], rel=1e-3)


def test_a_locking_angle_is_in_degrees(tmp_path, linear):
    """The strip shears by 62.5 degrees, where this law has 1.9 times the moment."""
    law = "--shear-law", "locking", "--shear-stiffness", "0.5"
    computed = summary(tmp_path, *law, "--set", "shear.locking_angle_deg=90")
    assert 1.1 < computed["shear_energy"] / linear["shear_energy"] < 1.9


def test_sine_and_toe_laws_change_shear_and_tension(tmp_path, linear):
    sine = ("--shear-law", "polynomial", "--set", "shear.coefficients_N_per_mm=[0.5]")
    energies = [
        summary(tmp_path, *sine, *more)["shear_energy"]
        for more in ((), ("--set", "shear.variable=sine"))
    ]
    assert energies[1] < 0.96 * energies[0]
    toe = (
        "--set",
        "tension.toe=0.004",
        "--set",
        "tension.initial_stiffness_N_per_mm=100",
    )
    crimped = ("--tension-law", "crimp-toe", *toe)
    computed = summary(tmp_path, "--shear-stiffness", "0.5", *crimped)
    assert computed["max_fibre_strain"] > 1.5 * linear["max_fibre_strain"]


CRIMPED = (
    *("--tension-law", "crimp-interchange", "--set", "tension.toe=0.004"),
    *(
        "--set",
        "tension.initial_stiffness_N_per_mm=100",
        "--set",
        "tension.bending_N_per_mm=1",
    ),
)


def test_an_interchange_without_crimp_equals_a_toe(tmp_path):
    toe = (
        "--set",
        "tension.toe=0.004",
        "--set",
        "tension.initial_stiffness_N_per_mm=100",
    )
    alone = summary(tmp_path, "--tension-law", "crimp-toe", *toe)
    summaries = [
        summary(
            tmp_path,
            *CRIMPED,
            "--set",
            f"tension.warp_crimp={c}",
            "--set",
            "tension.weft_crimp=0",
        )
        for c in ("0", "0.01")
    ]
    assert summaries[0]["energy"] == pytest.approx(alone["energy"], rel=1e-9)
    assert summaries[1]["energy"] < 0.99 * alone["energy"]


def test_a_table_is_extrapolated_with_one_warning_on_request(tmp_path, capsys):
    file = write_table(tmp_path, "law.csv", SHEAR + "0,0\n20,0.2\n40,0.5\n")
    law = ("--shear-law", file, "--set", "shear.continuation=odd")
    assert run(tmp_path, *QUICK, *law, "--set", "shear.extrapolation=linear") == 0
    stderr = capsys.readouterr().err
    assert stderr.count("extrapolated linearly") == 1


def test_a_checkpoint_distinguishes_tables_by_their_points(tmp_path, capsys):
    folder = str(tmp_path / "c")
    file = write_table(tmp_path, "law.csv", SHEAR + "0,0\n90,1\n")
    law = ("--shear-law", file, "--set", "shear.continuation=odd")
    assert run(tmp_path, *QUICK, *law, "--checkpoint", folder) == 0
    assert run(tmp_path, *QUICK, *law, "--resume", folder) == 0
    write_table(tmp_path, "law.csv", SHEAR + "0,0\n90,1.01\n")
    capsys.readouterr()
    command = ("run", "strip", "--out", str(tmp_path / "new"), *QUICK, *law)
    message = rejected(capsys, *command, "--resume", folder)
    assert "belongs to another run: shear law was Tabulated(" in message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--shear-law", "sin"),
            "shear.law is 'sin': expected one of linear, sin2, FILE.csv",
        ),
        (("--shear-law", "no.csv"), "shear.law no.csv: no such file"),
        (("--shear-law", "FILE.csv"), "shear.law FILE.csv: no such file"),
        (
            ("--tension-law", "sin2"),
            "'sin2': expected one of linear, FILE.csv, crimp-toe, crimp-interchange",
        ),
        (CRIMPED, "tension.warp_crimp is missing"),
        (
            (
                *CRIMPED,
                "--set",
                "tension.warp_crimp=-1",
                "--set",
                "tension.weft_crimp=0",
            ),
            "tension crimp must be a finite number >= 0, got -1.0",
        ),
        (
            (
                *CRIMPED,
                "--set",
                "tension.warp_crimp=1",
                "--set",
                "tension.weft_crimp=0",
            ),
            "tension crimp must be a ratio of at most 0.5, such as 0.01 for 1 %",
        ),
        (
            ("--shear-law", "crimp-interchange"),
            "'crimp-interchange': expected one of linear, sin2",
        ),
        (("--shear-law", "locking"), "shear.locking_angle_deg is missing"),
        (
            (
                *("--shear-law", "locking", "--shear-stiffness", "1"),
                *("--set", "shear.locking_angle_deg=120"),
            ),
            "shear.locking_angle_deg must be a number <= 90.0",
        ),
        (("--tension-law", "crimp-toe"), "tension.toe is missing"),
        (
            ("--shear-law", "locking", "--set", "shear.locking_angle_deg=60"),
            "shear stiffness must be a finite number > 0, got 0.0",
        ),
        (
            ("--shear-law", "polynomial", "--set", "shear.coefficients_N_per_mm=1,a"),
            "shear.coefficients_N_per_mm must be an array, got text",
        ),
        (
            ("--shear-law", "sin2", "--set", "shear.locking_angle_deg=60"),
            "shear.locking_angle_deg requires that shear.law is locking",
        ),
        (
            ("--set", "tension.extrapolation=linear"),
            "tension.extrapolation requires that tension.law is FILE.csv",
        ),
    ],
)
def test_invalid_laws_are_rejected(tmp_path, capsys, options, message):
    out = ("--out", str(tmp_path / "out"))
    assert message in rejected(capsys, "run", "strip", *QUICK, *out, *options)


def test_a_file_without_a_table_of_the_law_is_rejected(tmp_path, capsys):
    out = ("--out", str(tmp_path / "out"))
    file = write_table(tmp_path, "law.csv", TENSION + "0,0\n0.2,1\n0.1,2\n")
    line = rejected(capsys, "run", "strip", *QUICK, *out, "--tension-law", file)
    assert "row 4: the argument 0.1 must be larger than the previous one, 0.2" in line
    line = rejected(capsys, "run", "strip", *QUICK, *out, "--shear-law", file)
    assert "law.csv, row 1: the header must be of the form 'shear angle (deg)" in line
    more = ("--tension-law", file, "--fibre-stiffness", "3")
    line = rejected(capsys, "run", "strip", *QUICK, *out, *more)
    assert (
        "tension.stiffness_N_per_mm requires that tension.law is linear or crimp-toe"
        in line
    )


def test_no_exact_solution_is_given_for_an_angle_beyond_a_pole(tmp_path):
    """Fibres stretch before they reach the pole; 40 degrees are not reached."""
    line = ["run", "bias_extension", "--size", "4x8", "--steps", "4", "--no-render"]
    law = ["--shear-law", "locking", "--set", "shear.locking_angle_deg=35"]
    assert cli.main([*line, *law, "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["exact_answer"].startswith("none: for inextensible fibres")
    assert "load_over_exact" not in summary
