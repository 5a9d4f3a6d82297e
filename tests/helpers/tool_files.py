"""Tools of triangles, their files, and runs of the command line on them."""

import json

import meshio
import numpy as np

from skfem_textile.cli import main as cli
from tests.helpers import graph, sphere

SMALL = "--size", "6x6", "--steps", "2", "--no-render"

#: Fibres that resist bending, without tension: no net takes time.
BENT = "--tension", "0", "--set", "bending.warp_N_mm=5", "bending.weft_N_mm=5"


def write(file, x, triangles):
    meshio.write_points_cells(file, np.transpose(x), [("triangle", triangles.T)])
    return file


def ball(file, n=2502, radius=100.0, centre=(13.0, -7.0, 40.0)):
    """A sphere of 2n − 4 triangles, as an STL file."""
    x, t = sphere(n)
    return write(file, radius * x + np.array(centre)[:, None], t)


def bump(x, y):
    return 30 * np.exp(-((x - 5) ** 2 + 1.5 * y**2) / 3200)


def plate(side=100.0, n=29, height=bump):
    """Points and triangles of a tool z = h(x, y) over a square."""
    return graph(np.linspace(-side, side, n), height)


def line(out, *options, tool):
    """Words of the command that runs a small ply on a tool."""
    words = "run", "drape", "--tool", str(tool), *SMALL, *BENT, *options
    return [*words, "--out", str(out)]


def command(out, *options, tool):
    return cli.main(line(out, *options, tool=tool))


def summary(out):
    return json.loads((out / "summary.json").read_text())
