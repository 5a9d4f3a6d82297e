"""The command ``fit``: from curves of tests to a fabric that runs can read."""

import json

import numpy as np
import pytest

from skfem_textile import CrimpToe, Polynomial
from skfem_textile.calibration import BiasExtension, PictureFrame
from skfem_textile.cli import main as cli
from skfem_textile.cli.fit_options import TESTS
from skfem_textile.fabric.files import read_law
from skfem_textile.io import read_fabric
from tests.helpers.command_line import rejected, run
from tests.helpers.pages import Page

LAW = Polynomial((0.1, 0.0, -0.1, 0.0, 0.5))
SIZES = "--width", "100", "--height", "200"


def table(path, header, *columns):
    rows = zip(*columns, strict=True)
    lines = [header, *(",".join(f"{x:.9g}" for x in row) for row in rows)]
    path.write_text("\n".join(lines))
    return str(path)


def curves(folder, test, n=3, noise=0.02):
    gamma = np.radians(np.linspace(1.0, 40.0, 40))
    force = test.force(LAW, gamma)
    for i in range(n):
        dF = noise * force.max() * np.random.default_rng(i).standard_normal(40)
        header = "displacement (mm),force (N)"
        yield table(folder / f"{i}.csv", header, test.displacement(gamma), force + dF)


def fit(*arguments):
    return cli.main(["fit", *map(str, arguments)])


@pytest.mark.parametrize(
    ("kind", "test", "sizes"),
    [
        ("bias-extension", BiasExtension(100.0, 200.0), SIZES),
        (
            "picture-frame",
            PictureFrame(200.0, 160.0),
            ("--frame-side", 200, "--fabric-side", 160),
        ),
    ],
)
def test_a_fit_writes_a_law_that_a_run_reads(kind, test, sizes, tmp_path, capsys):
    data, out = curves(tmp_path, test), tmp_path / "fit"
    zeros = "--slack", 0, "--force-at-rest", 0
    assert fit(kind, *data, *sizes, *zeros, "--out", out, "--no-render") == 0
    names = {file.name for file in out.iterdir()}
    assert names == {"law.json", "fabric.json", "report.html", "summary.json"}
    law = read_law(out / "law.json")
    assert read_fabric(out / "fabric.json").fabric.shear_law == law
    gamma = np.radians([10.0, 40.0])
    np.testing.assert_allclose(law.value(gamma), LAW.value(gamma), rtol=0.1)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["laws"]["Shear"]["largest_angle_deg"] == pytest.approx(40.0)
    assert "read: separator comma" in capsys.readouterr().out
    quick = "--size", "3x4", "--steps", "2", "--no-render", "--tension-law", "linear"
    assert run(tmp_path, *quick, "--shear-law", str(out / "law.json")) == 0


def test_tension_and_shear_are_fitted_into_one_fabric(tmp_path, capsys):
    toe, e = CrimpToe(5e3, 0.004, 10.0), np.linspace(0.0, 0.02, 30)[1:]
    force = 100 * toe.value(np.log1p(e)) / (1 + e)
    header = "warp strain (-),warp force (N),weft strain (-),weft force (N)"
    pull = table(tmp_path / "pull.csv", header, e, force, e, force)
    data = curves(tmp_path, BiasExtension(100.0, 200.0))
    one, two = tmp_path / "one", tmp_path / "two"
    assert fit("bias-extension", *data, *SIZES, "--out", one, "--no-render") == 0
    widths = "--warp-width", 100, "--weft-width", 100, "--fabric", one / "fabric.json"
    capsys.readouterr()
    how = "--slack", 0, "--out", two, "--no-render"
    assert fit("biaxial", pull, *widths, *how) == 0
    assert "fabric.json contains" not in capsys.readouterr().out
    fabric = read_fabric(two / "fabric.json").fabric
    assert fabric.shear_law == read_law(one / "law.json")
    for family in fabric.families:
        assert family.tension.stiffness == pytest.approx(5e3, rel=1e-3)
    assert read_law(two / "warp_law.json") == fabric.families[0].tension


def test_a_fabric_lists_the_properties_that_were_not_fitted(tmp_path, capsys):
    data = list(curves(tmp_path, BiasExtension(100.0, 200.0), n=1))
    shear = "bias-extension", *data, *SIZES, "--no-render", "--out", tmp_path / "o"
    assert fit(*shear) == 0
    message = "the fibre stiffness in fabric.json is the default, 100000 N/mm"
    assert message in capsys.readouterr().out
    assert fit(*shear, "--fibre-stiffness", 2e4) == 0
    assert message not in capsys.readouterr().out
    header = "warp strain (-),warp force (N),weft strain (-),weft force (N)"
    e = np.linspace(0.001, 0.02, 20)
    pull = table(tmp_path / "pull.csv", header, e, 4e4 * e, e, 4e4 * e)
    widths = "--warp-width", 100, "--weft-width", 100, "--law", "linear"
    out = "--out", tmp_path / "o", "--no-render"
    assert fit("biaxial", pull, *widths, *out) == 0
    assert "fabric.json contains no shear stiffness" in capsys.readouterr().out


def test_a_table_is_extrapolated_on_request(tmp_path):
    (data,) = curves(tmp_path, BiasExtension(100.0, 200.0), n=1)
    header = "warp strain (-),warp force (N),weft strain (-),weft force (N)"
    e = np.linspace(0.001, 0.02, 20)
    pull = table(tmp_path / "pull.csv", header, e, 4e4 * e, e, 4e4 * e)
    out = tmp_path / "o"
    how = "--law", "tabulated", "--no-render", "--out", out
    beyond = "--extrapolation", "linear"
    assert fit("bias-extension", data, *SIZES, *how) == 0
    assert read_law(out / "law.json").extrapolation == "refuse"
    assert fit("bias-extension", data, *SIZES, *how, *beyond) == 0
    assert read_law(out / "law.json").extrapolation == "linear"
    widths = "--warp-width", 100, "--weft-width", 100, "--fabric", out / "fabric.json"
    assert fit("biaxial", pull, *widths, *how, *beyond) == 0
    fabric = read_fabric(out / "fabric.json").fabric
    assert {law.extrapolation for law in fabric.laws} == {"linear"}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["laws"]["Tension of the warp"]["law"]["extrapolation"] == "linear"


def test_simulated_tests_are_fitted(tmp_path):
    data = curves(tmp_path, BiasExtension(100.0, 200.0), noise=0.0)
    how = "--simulate", 4, "--fibre-stiffness", 1e6, "--law", "sin2", "--no-render"
    assert fit("bias-extension", *data, *SIZES, *how, "--out", tmp_path / "o") == 0
    fabric = read_fabric(tmp_path / "o" / "fabric.json").fabric
    assert fabric.families[0].tension.stiffness == 1e6
    summary = json.loads((tmp_path / "o" / "summary.json").read_text())
    assert summary["laws"]["Shear"]["compared_with"] == "simulations"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["missing.csv", *SIZES], "missing.csv"),
        (["0.csv", "--width", "100"], "--height is missing"),
        (["0.csv", "--width", "1", "2", "--height", "9"], "--width has 2 values for 1"),
        (
            ["0.csv", *SIZES, "--law", "spline"],
            "unknown law 'spline': choose one of polynomial",
        ),
        (["0.csv", *SIZES, "--bound", "c1=2,1"], "such as c1=0,1, got 'c1=2,1'"),
        (["0.csv", *SIZES, "--unit", "force"], "such as force=kN, got 'force'"),
        (["0.csv", *SIZES, "--unit", "time=s"], "--unit time: unknown column"),
        (
            ["0.csv", *SIZES, "--fabric", "0.csv"],
            "0.csv: fabrics can be read only from",
        ),
        (["0.csv", *SIZES, "--extrapolation", "linear"], "omit the extrapolation"),
        (["0.csv", *SIZES, "--extrapolation", "cubic"], "invalid choice"),
        (["0.csv", *SIZES, "--warp", "60"], "must be at least 346.41 mm high"),
    ],
)
def test_invalid_input_is_rejected_in_one_line_and_writes_nothing(
    arguments, text, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    list(curves(tmp_path, BiasExtension(100.0, 200.0), n=1))
    assert text in rejected(capsys, "fit", "bias-extension", *arguments, "--out", "o")
    assert not (tmp_path / "o").exists()


def joint_file(folder):
    """A file of tests of three kinds, with their data."""
    list(curves(folder, BiasExtension(100.0, 200.0), n=2))
    e = np.linspace(0.0, 0.02, 40)
    force = 4e3 * 50.0 * np.log1p(e) / (1 + e)
    table(folder / "strip.csv", "displacement (mm);force (N)", 200 * e, force)
    text = (folder / "strip.csv").read_text().replace(",", ";")
    (folder / "strip.csv").write_text(text)
    (folder / "bend.csv").write_text("overhang (mm)\n200\n201\n199.5\n")
    file = folder / "tests.toml"
    file.write_text(
        """
        [[test]]
        kind = "bias-extension"
        data = ["0.csv", "1.csv"]
        width = 100
        height = 200
        slack = 0

        [[test]]
        kind = "strip"
        data = "strip.csv"
        family = "weft"
        width = 50
        length = 200

        [[test]]
        kind = "cantilever"
        data = "bend.csv"
        weight = 6e-6
        chord_angle = 41.5
        """
    )
    return file


def test_tests_of_several_kinds_are_fitted_jointly(tmp_path, capsys):
    file, out = joint_file(tmp_path), tmp_path / "o"
    how = "--tension-law", "linear", "--no-render", "--out", out
    assert fit("joint", file, *how) == 0
    fabric = read_fabric(out / "fabric.json").fabric
    assert fabric.shear_law == read_law(out / "shear_law.json")
    assert fabric.families[1].tension == read_law(out / "weft_law.json")
    assert fabric.families[1].tension.stiffness == pytest.approx(4e3)
    assert fabric.bending[0] == pytest.approx(6.0, rel=0.02)
    summary = json.loads((out / "summary.json").read_text())
    names = summary["joint"]["parameters"]
    assert names == [
        *("weft stiffness", "shear c1", "shear c3", "shear c5"),
        "bending warp stiffness",
    ]
    assert len(summary["joint"]["correlations"]) == len(names)
    printed = capsys.readouterr().out
    for title in ("Shear ", "Tension of the weft ", "Bending of the warp "):
        assert f"\n{title}" in printed
    assert "the tension of the warp in fabric.json is the default" in printed


def test_a_strip_is_fitted_alone(tmp_path):
    joint_file(tmp_path)
    strip = "strip", tmp_path / "strip.csv", "--width", 50, "--length", 200
    how = "--law", "linear", "--no-render", "--out", tmp_path / "o"
    assert fit(*strip, *how) == 0
    assert read_law(tmp_path / "o" / "law.json").stiffness == pytest.approx(4e3)


def held_out(folder, kind="bias-extension", scale=1.0, sizes=(80, 200)):
    """A test of another size, and the file that names it."""
    test = BiasExtension(80.0, 200.0)
    gamma = np.radians(np.linspace(1.0, 35.0, 30))
    force = scale * test.force(LAW, gamma)
    header = "displacement (mm),force (N)"
    table(folder / "held.csv", header, test.displacement(gamma), force)
    text = f'[[test]]\nkind = "{kind}"\ndata = "held.csv"\nslack = 0\n'
    file = folder / "held.toml"
    file.write_text(f"{text}width = {sizes[0]}\nheight = {sizes[1]}\n")
    return file


def test_a_test_that_was_not_used_is_predicted_and_compared(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    data = list(curves(tmp_path, BiasExtension(100.0, 200.0)))
    out = tmp_path / "o"
    known = *SIZES, "--slack", 0, "--force-at-rest", 0, "--out", out
    validated = "--fibre-stiffness", 1e6, "--validate"
    assert fit("bias-extension", *data, *known, *validated, held_out(tmp_path)) == 0
    (row,) = json.loads((out / "summary.json").read_text())["validation"]["rows"]
    assert row["confirmed"]
    assert row["inside_simultaneous"] == 1.0
    assert row["largest_over_largest_force"] < 0.05
    error = f"{100 * row['rms_over_largest_force']:.2g} % of its largest value, rms"
    first = f"Prediction of held.csv  error of the load {error}: confirmed, "
    assert first in capsys.readouterr().out
    page = Page((out / "report.html").read_text(encoding="utf-8"))
    for part in ("Inside the band of the curve", "Load lost to fibre stretch"):
        assert part in page.text
    assert page.tags.count("img") == 3 + 2 + 1 + 1 + 1  # data, law, residuals, held
    wrong = held_out(tmp_path, scale=1.3)
    how = *validated, wrong, "--no-render"
    assert fit("bias-extension", *data, *known, *how) == 0
    assert "the prediction is not confirmed" in capsys.readouterr().out
    assert "not confirmed, only" in Page((out / "report.html").read_text()).text


def test_only_shear_tests_are_predicted(tmp_path, capsys):
    data = list(curves(tmp_path, BiasExtension(100.0, 200.0)))
    joint = joint_file(tmp_path)
    arguments = "bias-extension", *data, *SIZES, "--validate", joint
    out = "--out", tmp_path / "o"
    line = rejected(capsys, "fit", *map(str, (*arguments, *out)))
    assert "only bias extensions and picture frames" in line


def test_a_fit_without_a_shear_law_is_not_validated(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("skfem_textile.cli.fit.fit_tests", pytest.fail)
    (tmp_path / "bend.csv").write_text("overhang (mm)\n200\n201\n199\n")
    test = 'kind = "cantilever"\ndata = "bend.csv"\nweight = 6e-6\nchord_angle = 40\n'
    (tmp_path / "tests.toml").write_text(f"[[test]]\n{test}")
    how = "--validate", held_out(tmp_path), "--out", tmp_path / "o"
    line = rejected(capsys, *map(str, ("fit", "joint", tmp_path / "tests.toml", *how)))
    assert "--validate requires a fitted shear law" in line


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[[test]]", "[[tests]]", "the file must consist of tables [[test]]"),
        ("[[test]]", "[test", "the file is not valid TOML"),
        ('kind = "strip"', 'kind = "pull"', "test 2: the kind must be one of strip"),
        ('data = "strip.csv"', "data = 3", "test 2: data must be the name of a file"),
        ("family =", "side =", "test 2: unknown key 'side': choose one of family"),
        ('"weft"', '"fill"', "test 2, family: must be one of warp, weft"),
        ("width = 50", 'width = "w"', "test 2, width: could not convert"),
        ("length = 200", "", "test 2: --length is missing"),
        ("slack = 0", "slack = [0, 1]", "test 1, slack: must be a single value"),
        ("strip.csv", "missing.csv", "missing.csv"),
    ],
)
def test_an_invalid_file_of_tests_is_rejected_in_one_line(
    old, new, message, tmp_path, capsys
):
    file = joint_file(tmp_path)
    file.write_text(file.read_text().replace(old, new))
    line = rejected(capsys, "fit", "joint", str(file), "--out", str(tmp_path / "o"))
    assert message in line
    assert not (tmp_path / "o").exists()


def test_a_tension_law_is_rejected_as_a_shear_law(tmp_path, capsys):
    (tmp_path / "law.json").write_text(
        '{"kind": "CrimpToe", "stiffness": 1, "toe": 1, "initial_stiffness": 1}'
    )
    file = str(tmp_path / "law.json")
    command = "run", "strip", "--out", str(tmp_path / "o"), "--shear-law", file
    assert "contains a CrimpToe, which is not a law of shear" in rejected(
        capsys, *command
    )


def test_the_help_lists_every_law():
    from skfem_textile.calibration.choice import SHEAR_LAWS, TENSION_LAWS

    flags = {"joint": {"--shear-law", "--tension-law"}, "cantilever": set()}
    for test, (_, options) in TESTS.items():
        laws = {flag for flag in options if flag.endswith("law")}
        assert laws == flags.get(test, {"--law"})
        for flag in laws:
            tension = flag == "--tension-law" or test in ("strip", "biaxial")
            names = TENSION_LAWS if tension else SHEAR_LAWS
            assert all(name in options[flag]["help"] for name in names)
