"""Tools of triangles, their files, and runs of the command line on them."""

import json

import meshio
import numpy as np
from scipy.spatial import ConvexHull

from skfem_textile.cli import main as cli

SMALL = "--size", "6x6", "--steps", "2", "--no-render"

#: Fibres that resist bending, without tension: no net takes time.
BENT = "--tension", "0", "--bending-warp", "5", "--bending-weft", "5"


def write(file, x, triangles):
    meshio.write_points_cells(file, np.transpose(x), [("triangle", triangles.T)])
    return file


def ball(file, n=2502, radius=100.0, centre=(13.0, -7.0, 40.0)):
    """A sphere of 2n − 4 triangles, as an STL file."""
    k = np.arange(n) + 0.5
    z, around = 1 - 2 * k / n, np.pi * (1 + 5**0.5) * k
    x = np.array([np.cos(around), np.sin(around), np.ones(n)])
    x[:2] *= np.sqrt(1 - z * z)
    x[2] = z
    t = ConvexHull(x.T).simplices.T.copy()
    a, b, c = x[:, t[0]], x[:, t[1]], x[:, t[2]]
    inwards = (np.cross(b - a, c - a, axis=0) * a).sum(axis=0) < 0
    t[1:, inwards] = t[:0:-1, inwards]
    return write(file, radius * x + np.array(centre)[:, None], t)


def bump(x, y):
    return 30 * np.exp(-((x - 5) ** 2 + 1.5 * y**2) / 3200)


def plate(side=100.0, n=29, height=bump):
    """Points and triangles of a tool z = h(x, y) over a square."""
    s = np.linspace(-side, side, n)
    x, y = (a.ravel() for a in np.meshgrid(s, s))
    k = np.add.outer(n * np.arange(n - 1), np.arange(n - 1)).ravel()
    t = np.hstack([[k, k + 1, k + n + 1], [k, k + n + 1, k + n]])
    return np.array([x, y, height(x, y) + 0 * x]), t


def line(out, *options, tool):
    """Words of the command that runs a small ply on a tool."""
    words = "run", "drape", "--tool", str(tool), *SMALL, *BENT, *options
    return [*words, "--out", str(out)]


def command(out, *options, tool):
    return cli.main(line(out, *options, tool=tool))


def summary(out):
    return json.loads((out / "summary.json").read_text())
