"""Bad input is refused in one line that names it, and no file is written."""

import shlex

import numpy as np
import pytest

from skfem_textile import (
    CrimpToe,
    Fabric,
    Linear,
)
from skfem_textile.cases import CaseFileError, case_from_tables
from skfem_textile.fabric.directions import directions_of
from skfem_textile.fabric.files import write_law
from skfem_textile.io import write_directions, write_fabric
from skfem_textile.scenes import bias_extension
from tests.helpers.command_line import MESH, rejected
from tests.helpers.curves import joint_file, write_columns
from tests.helpers.specimen import SPECIMEN, write_case
from tests.helpers.tool_shapes import cap
from tests.helpers.tools import write

HOLE = MESH.with_name("hole.msh")
LOCKING, LAST = "--shear-law locking", "--set shear.locking_angle_deg"
SIZES = "--width 100 --height 200"
NINES = "9" * 23

#: A beginning of a command line, its further words, and the text of its message.
LINES = {
    "run": [
        ("stripe", "'stripe'"),
        ("strip --shear-law no.csv --out out", "--shear-law no.csv: no such file"),
        ("no.toml --out out", "no.toml"),
        ("folder.toml --out out", "folder.toml"),
    ],
    "init": [("x.txt", "must end with .toml")],
    "run strip --out file/out": [("", "file")],
    "run strip --out out": [
        # numbers
        ("--fibre-stiffness 0", "no stiffness"),
        ("--shear-stiffness nan", "must be a finite number, got nan"),
        ("--shear-stiffness 1e308", "force of a law is not finite at rest"),
        (f"--steps {NINES}", f"from 1 to 1000000, got {NINES}"),
        ("--rotate 1e17", "--rotate must be a number <= 36000.0"),
        # meshes
        ("--size 1000000x1000000", "llocate"),
        ("--size 99999999999x1", "--size must be an integer <= 1000000"),
        ("--set mesh.seed=-1", "seed must be"),
        ("--mesh curly", "curly is neither an existing file nor one of graded"),
        ("--mesh 'a\nb\x1b[31m'", r"--mesh a\nb\x1b[31m is neither an"),
        ("--mesh bad.msh", "bad.msh"),
        (f"--mesh {MESH} --set mesh.seed=2", "mesh.seed does not apply to the mesh"),
        # formulations
        ("--formulation fuller", "--formulation"),
        ("--set formulation.cs_N_per_mm=-1", "stabilisation must be"),
        (
            "--set formulation.cs_N_per_mm=4 formulation.stabilisation=rate",
            "stabilisation requires that --formulation is one-point",
        ),
        ("--set 'formulation.name=x - at $.y'", "is 'x - at $.y': expected one of"),
        # stepping
        ("--set 'stepping.warn_only=[\"magic\"]'", "stepping.warn_only is 'magic'"),
        ("--resume '--paper x'", "'--paper x' is not an option"),
        ("--resume file/c", "cannot write to checkpoint"),
        ("--checkpoint c --resume d", "name different folders"),
        # words
        ("--set steps=4", "such as stepping.steps=5, got 'steps=4'"),
        ("--set scene.name.x=4", "name is a value, not a table"),
        ("--set scene.name=trellis", "name the scene after `run`"),
        ("--set mesh.seed=2 mesh.seed=3", "mesh.seed is given twice"),
        ("--set 'stepping.steps=2\nfoo=9'", "stepping.steps must be an integer"),
        (f"--set scene.{'a.' * 1500}b=1", "expected KEY=VALUE, such as stepping.st"),
        ("--size=--", "expected a value, got"),
        *(
            (f"--{x} ''", f"argument --{x}: the name of a folder must not be empty")
            for x in ("out", "checkpoint", "resume")
        ),
        # loads
        ("--force top=1", "--force must be an array"),
        ("--force =1,2", "argument --force: expected NAME=VALUE, such as top=0,40"),
        ("--force lid=1,2", "no boundary 'lid'"),
        # laws
        ("--shear-law sin", "'sin': expected one of linear, sin2, FILE.csv"),
        ("--shear-law FILE.csv", "--shear-law FILE.csv: no such file"),
        (f"{LOCKING} {LAST}=60", "shear stiffness must be a finite number > 0, got 0"),
        (f"{LOCKING} {LAST}=120", "shear.locking_angle_deg must be a number <= 90.0"),
        ("--set tension.file=a.csv", "a table of a law has no key"),
        ("--shear-law tension.csv", "row 1: the header must be of the form 'shear ang"),
        (
            "--tension-law tension.csv --fibre-stiffness 3",
            "--fibre-stiffness requires that --tension-law is linear or crimp-",
        ),
        ("--shear-law toe.json", "contains a CrimpToe, which is not a law of shear"),
        # curves of tests
        ("--test-curve no.csv", "--test-curve no.csv: no such file"),
    ],
    "run trellis --out out": [
        ("--free lid", "argument --free: invalid choice: 'lid'"),
        ("--free left --roller left=3", "the side left is both in --free"),
        ("--roller left", "such as top=0,40, got 'left'"),
        ("--roller left=up", "--roller must be a number, got text"),
        ("--roller lid=3", "--roller is 'lid': expected one of top, right"),
        ("--roller left=nan", "scene.roller_deg.left must be a finite number"),
        ("--roller top=1 --roller top=2", "top is given twice"),
    ],
    "run bias_extension --out out": [
        ("--fibres 30 --weft 135", "got 30 and 135"),
        ("--tolerance 2", "must be between 0 and 1"),
        ("--tolerance 0.1 --checkpoint", "cannot write checkpoints"),
        (
            "--size 2x4 --tolerance 0.1 --set stepping.most_unknowns=10",
            "more than most_unknowns, 10",
        ),
        ("--set stepping.most_unknowns=9", "most_unknowns requires --tolerance"),
    ],
    "run bias_extension --size 3x6 --out out": [
        ("--set fabric.thickness_mm=0.3", "fabric.thickness_mm requires --fabric"),
        ("--fabric cloth.json --fibre-stiffness 1", "[tension] sets a law"),
        ("--directions ply.vtu", "there are 32 fibre directions for 18 elements"),
    ],
    f"run specimen --mesh {HOLE} --tolerance 0.1 --out out": [
        ("--set regions.all.shear.law=linear", "not possible with regions: omit --tol"),
        ("--directions other.csv", "not possible with --directions: omit --tol"),
    ],
    "run cantilever --out out": [
        (f"--mesh {HOLE} --tolerance 0.1", "the scene cantilever, which is in space"),
    ],
    "show --out out": [
        ("none.vtu", "no such file"),
        ("cloth", "cloth is neither a file of a fabric nor a name in the catalogue"),
        ("cao2008-plain-weave --warp 0", "--warp applies to a mesh only"),
        ("ply.vtu --warp 0", "must be given together"),
        ("ply.vtu --warp east --weft 90", "degrees, got 'east'"),
        ("ply.vtu --warp 0 --weft 90 --directions x", "omit one"),
        ("ply.vtu --directions other.csv", "for 1 elements, but the mesh has 32"),
    ],
    "net --tool cap.stl --out out": [
        ("--cell -1", "expected a positive length in mm, got '-1'"),
        ("--cell 0.01", "the length of a cell must be between"),
        ("--point 0 0 90", "is further from the tool than"),
        ("--warp-along none.csv", "none.csv"),
        ("--darts", "--darts requires --locking-angle"),
        ("--best mean --point 0 0 0", "--best cannot be combined with --point"),
        ("--layer CUT", "--layer requires --outline"),
        ("--part-reach 2", "--part-reach requires --part-mesh or --deck"),
        ("--outline ply.csv --best", "--outline cannot be combined with --best"),
        ("--trim beyond.csv", "the curve leaves the tool: 3 of its 4 points are up to"),
        ("--trim metres.csv", "state this unit in the file, as 'x (m)' in the header"),
    ],
    "report": [("no", "no/summary.json is missing: name the results folder of a run")],
    "fit bias-extension --out out": [
        (f"missing.csv {SIZES}", "missing.csv"),
        ("0.csv --width 100", "--height is missing"),
        ("0.csv --width 1 2 --height 9", "--width has 2 values for 1"),
        (f"0.csv {SIZES} --law spline", "unknown law 'spline': choose one of polynomi"),
        (f"0.csv {SIZES} --bound c1=2,1", "such as c1=0,1, got 'c1=2,1'"),
        (f"0.csv {SIZES} --unit force", "such as force=kN, got 'force'"),
        (f"0.csv {SIZES} --fabric 0.csv", "0.csv: fabrics can be read only from"),
        (f"0.csv {SIZES} --warp 60", "must be at least 346.41 mm high"),
        (
            f"0.csv {SIZES} --validate tests.toml",
            "only bias extensions and picture frames",
        ),
    ],
    "fit joint --out out": [
        ("bend.toml --validate held.toml", "--validate requires a fitted shear law")
    ],
}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with the files that the lines name."""
    folder = tmp_path_factory.mktemp("messages")
    (folder / "folder.toml").mkdir()
    (folder / "file").touch()
    (folder / "bad.msh").write_text("no mesh")
    scene = bias_extension(size=(4, 8))
    fabric = Fabric(warp=scene.warp, weft=scene.weft)
    write_directions(folder / "ply.vtu", scene.mesh, directions_of(scene.mesh, fabric))
    write_fabric(folder / "cloth.json", Fabric())
    write_law(CrimpToe(1.0, 1.0, 0.5), folder / "toe.json")
    write_columns(
        folder / "other.csv", "element,warp_angle_deg,weft_angle_deg", 1, 0, 90
    )
    header = "fibre strain (-),tension (N/mm)"
    write_columns(folder / "tension.csv", header, [0, 0.2, 0.1], [0, 1, 2])
    write(folder / "cap.stl", *cap())
    beyond = [60, 0, -60, 0], [0, 60, 0, 0], [-20, -20, -20, 0]
    write_columns(folder / "beyond.csv", "x,y,z", *beyond)
    low = np.sqrt(8400) - 100
    metres = 1e-3 * np.array([[40, 0, -40], [0, 40, 0], [low] * 3])
    write_columns(folder / "metres.csv", "x,y,z", *metres)
    joint_file(folder, Linear(4e3))
    size = 'data = "0.csv"\nwidth = 100\nheight = 200\n'
    (folder / "held.toml").write_text(f'[[test]]\nkind = "bias-extension"\n{size}')
    bend = 'kind = "cantilever"\ndata = "bend.csv"\nweight = 6e-6\nchord_angle = 40\n'
    (folder / "bend.toml").write_text(f"[[test]]\n{bend}")
    return folder


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (f"{beginning} {words}", text)
        for beginning, rows in LINES.items()
        for words, text in rows
    ],
)
def test_a_line_is_refused(line, text, files, capsys, monkeypatch):
    monkeypatch.chdir(files)
    if "--validate" in line:  # before the fit
        monkeypatch.setattr("skfem_textile.cli.fit.fit_tests", lambda *_: 1 / 0)
    before = sorted(files.rglob("*"))
    assert text in rejected(capsys, *shlex.split(line))
    assert sorted(files.rglob("*")) == before


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("[[test]]", "[[tests]]", "the file must consist of tables [[test]]"),
        ("[[test]]", "[test", "the file is not valid TOML"),
        ('kind = "strip"', 'kind = "pull"', "test 1: the kind must be one of strip"),
        ('data = "weft.csv"', "data = 3", "test 2: data must be the name of a file"),
        ("family =", "side =", "test 2: unknown key 'side': choose one of family"),
        ('"weft"', '"fill"', "test 2, family: must be one of warp, weft"),
        ("width = 50", 'width = "w"', "test 1, width: could not convert"),
        ("length = 200", "", "test 1: --length is missing"),
        ("width = 50", "width = 50\nslack = [0, 1]", "test 1, slack: must be a single"),
        ("warp.csv", "missing.csv", "missing.csv"),
    ],
)
def test_a_file_of_tests_is_refused(old, new, text, files, tmp_path, capsys):
    content = (files / "tests.toml").read_text()
    assert old in content
    file = tmp_path / "tests.toml"
    file.write_text(content.replace(old, new))
    for data in files.glob("*.csv"):
        (tmp_path / data.name).symlink_to(data)
    out = str(tmp_path / "o")
    assert text in rejected(capsys, "fit", "joint", str(file), "--out", out)
    assert not (tmp_path / "o").exists()


#: Changes of the case file of a specimen.
CASES = [
    ("steps = 2", "stepz = 2", "stepping has no key 'stepz'; did you mean 'steps'"),
    ("[stepping]", "[steping]", "there is no table 'steping'; did you mean 'st"),
    ("steps = 2", "steps = 2.5", "stepping.steps must be an integer, got a number"),
    ("steps = 2", "steps = 0", "steps must be a whole number"),
    ("steps = 2", "steps", "the file is not valid TOML: "),
    ("stiffness_N_per_mm", "stiffness", "did you mean 'stiffness_N_per_mm'"),
    ("height_mm = 110", "height_cm = 11", "did you mean 'height_mm'"),
    ("= 110", "= nan", "scene.height_mm must be a finite number, got nan"),
    ("rotate_deg", "bend_deg", "scene.bend_deg requires that scene.name is trellis"),
    ('"specimen"', '"speciment"', "scene.name is 'speciment': expected one of"),
    ("[shear]", "[tension.weft]\ntoe = 1\n[shear]", "tension.weft.toe requires"),
    ("[shear]", "[tension.wefd]\n[shear]", "'wefd'; did you mean 'weft'"),
    ("[shear]", "[tension.in_compression]\n[shear]", "in_compression is a law"),
    ("[shear]", "[tension.weft.weft]\n[shear]", "tension.weft has no key 'weft'"),
    (
        'compression = "none"',
        "pretension_N_per_mm = -1",
        "tension pretension must be a finite number >= 0",
    ),
    ("toe = 0.004\n", "", "tension.toe is missing"),
    ('"crimp-toe"', '"linear"', "tension.toe requires that tension.law is crimp-toe"),
    (
        '"crimp-toe"',
        '"crimp-interchange"\nwarp_crimp = 1\nweft_crimp = 0\nbending_N_per_mm = 1',
        "tension crimp must be a ratio of at most 0.5, such as 0.01 for 1 %",
    ),
    ("tables/shear", "shear", "shear.law "),
    ('"odd"', '"old"', "'old': expected one of none, odd; did you mean 'odd'"),
    ('"one-point"', '"full"', "formulation.cs_N_per_mm requires that formulation.name"),
    ("= 2\n[loads", "= 'aut'\n[loads", "is 'aut': expected one of a number, auto"),
    ('["free", 12]', '["fre", 12]', "scene.move_mm is 'fre': expected one of a number"),
    ("top = ", "lid = ", "the mesh has no boundary 'lid'"),
    ("size = [2, 3]", "size = [3]", "must be an array of length 2, got 1"),
    ("size = [2, 3]", "size = 1979-05-27", "must be an array, got a date"),
    ('"superlu"', '"supreme"', "expected one of auto, rslab"),
    ("[loads.force_N]", "[loads]\nforce_N = 1\n[x]", "force_N must be a table, got an"),
    ("[shear]", "[regions.a]\n[shear]", "no subdomain 'a' (available: none)"),
    ("[shear]", "[regions.a.tensio]\n[shear]", "regions.a has no key 'tensio'"),
    ("[shear]", "[fabric]\nfile = 'a.inp'\n[shear]", "[tension] sets a law, but fab"),
    ("[mesh]", "[mesh]\ndirections = 'a.csv'", "a.csv"),
]


@pytest.mark.parametrize(("old", "new", "text"), CASES)
def test_a_case_file_is_refused_and_quoted(tmp_path, capsys, old, new, text):
    assert old in SPECIMEN
    file = write_case(tmp_path, SPECIMEN.replace(old, new))
    reason = rejected(capsys, "run", str(file), "--out", str(tmp_path / "out"))
    assert text in reason
    assert "one.toml: " in reason
    assert "--" not in reason
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"\xff", "the file is not a text file in UTF-8"),
        (b"x = " + b"[" * 100_000, "too deeply"),
        (b"#" * 1_000_001, "at most 1000000 bytes"),
        (b"", "scene.name is missing: expected one of strip"),
        (b"scene = 3", "scene must be a table, not 3"),
        (b"[scene]\nname = 'strip'\n[stepping]\nsteps = " + b"9" * 5000, "valid TOML"),
    ],
)
def test_a_file_without_a_case_is_refused(tmp_path, capsys, content, text):
    file = tmp_path / "bad.TOML"
    file.write_bytes(content)
    assert text in rejected(capsys, "run", str(file), "--out", str(tmp_path / "o"))


STRIP = {"scene": {"name": "strip"}}
NESTED = {"scene": {"name": "strip"}}
NESTED["scene"]["again"] = NESTED


@pytest.mark.parametrize(
    ("tables", "text"),
    [
        (None, "a case must be a table of tables, not None"),
        (STRIP | {"loads": np.zeros(3)}, "loads is a ndarray"),
        (STRIP | {"mesh": {"size": {2, 3}}}, "size is a set"),
        (STRIP | {"shear": {"law": abs}}, r"shear\.law is a function, which a case"),
        (NESTED, "nested too deeply"),
    ],
)
def test_values_without_a_file_format_are_refused(tables, text):
    with pytest.raises(CaseFileError, match=text):
        case_from_tables(tables)


@pytest.mark.parametrize(
    ("curve", "text"),
    [
        ("force (N)\n1\n2\n", "the headings must name a displacement or an angle"),
        (
            "angle (deg),force (N),force (N)\n0,0,0\n1,1,1\n",
            "column 2 ('force') and column 3 ('force') may each be the force",
        ),
        ("angle (deg),force (N)\n0,0\n", "at least two rows"),
        ("\0\xff", "no rows of numbers"),
    ],
)
def test_a_file_without_a_curve_of_a_test_is_refused(tmp_path, capsys, curve, text):
    file = tmp_path / "test.csv"
    file.write_text(curve, encoding="latin-1")
    line = "run", "strip", "--test-curve", str(file), "--out", str(tmp_path / "out")
    assert text in rejected(capsys, *line)
    assert not (tmp_path / "out").exists()
