"""The case file of a specimen, runs of case files, and meshes of a strip in files."""

import json

import meshio
import numpy as np

from skfem_textile.cli import main as cli

SHEAR = "shear angle (deg),moment (N mm/mm2)\n0,0\n30,0.1\n60,0.8\n"

SPECIMEN = """
[scene]
name = "specimen"
height_mm = 110
rotate_deg = 20
[scene.move_mm]
bottom = [0, 0]
top = ["free", 12]
[mesh]
size = [2, 3]
as_is = true
[tension]
law = "crimp-toe"
stiffness_N_per_mm = 1000
toe = 0.004
initial_stiffness_N_per_mm = 10
compression = "none"
[shear]
law = "tables/shear.csv"
continuation = "odd"
[formulation]
name = "one-point"
cs_N_per_mm = 2
[loads.force_N]
right = [0.5, 0]
[stepping]
steps = 2
solver = "superlu"
[output]
pictures = false
"""


def write_case(tmp_path, text=SPECIMEN):
    """A case file, beside the table of a shear law."""
    (tmp_path / "tables").mkdir(exist_ok=True)
    (tmp_path / "tables" / "shear.csv").write_text(SHEAR)
    file = tmp_path / "one.toml"
    file.write_text(text)
    return file


def run(file, out):
    return cli.main(["run", str(file), "--out", str(out)])


def assert_runs_alike(before, after, *names):
    """The case written by a run gives the same files, to the last bit."""
    assert run(before / "case.toml", after) == 0
    for name in ("case.toml", "history.csv", *names):
        assert (before / name).read_bytes() == (after / name).read_bytes(), name


def summary_of(out):
    """Content of a summary except for times."""
    summary = json.loads((out / "summary.json").read_text())
    return {k: v for k, v in summary.items() if not k.endswith("_time_s")}


# Corners of the cells of a strip of 40 × 60 mm.
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
TRIANGLES = np.vstack([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]])

#: Cells of mesh files: of one kind, and of both.
CELLS = {
    "triangles": [("triangle", TRIANGLES)],
    "quadrilaterals": [("quad", QUADS)],
    "both": [("triangle", TRIANGLES[[0, 4]]), ("quad", QUADS[1:])],
}


def save_strip(path, kind):
    """A strip of cells of a kind in a file, its right edge named."""
    x, y = np.meshgrid([0.0, 20.0, 40.0], [0.0, 30.0, 60.0])
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    cells = CELLS[kind]
    tags = [*(np.full(len(c), 2) for _, c in cells), [1, 1]]
    meshio.Mesh(
        points,
        [*cells, ("line", [[2, 5], [5, 8]])],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"right": np.array([1, 1]), "ply": np.array([2, 2])},
    ).write(path, file_format="gmsh22")
    return str(path)
