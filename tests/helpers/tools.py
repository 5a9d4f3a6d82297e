"""Plies on tools: of analytic surfaces, of triangles, and of files."""

import json
from functools import cache

import meshio
import numpy as np
from scipy.interpolate import RegularGridInterpolator
from skfem import MeshQuad, MeshTri

from skfem_textile import Condition, Fabric, Macro, OnePoint, Ply, Quadratic, drape
from skfem_textile.cli import main as cli
from skfem_textile.scenes import Case, hemisphere
from skfem_textile.scenes.tools import shear_angle
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem
from tests.helpers import graph, sphere

# Square plies that are draped on surfaces, with symmetry conditions


RADIUS = 60.0
SYMMETRY = {
    "x": Condition("left", (0.0, None, None)),
    "y": Condition("bottom", (None, 0.0, None)),
}


def square(
    side=60.0,
    cells=4,
    fabric=None,
    formulation=None,
    loads=(),
    corner=(0.0, 0.0),
    mesh=MeshQuad,
):
    s = np.linspace(0, side, cells + 1)
    mesh = mesh.init_tensor(s, s).translated(corner).with_defaults()
    fabric, formulation = fabric or Fabric(1e4, 0.1), formulation or OnePoint()
    return Ply(mesh, fabric, formulation, loads, dimension=3)


def problem_of(ply, conditions):
    constraints = Constraints(ply.basis, conditions)
    return Problem(ply, constraints, solver_named("superlu"))


def geodesic_u(ply, surface, **options):
    """The displacement that places a ply on a surface along its geodesics."""
    x = drape.exponential_map(surface, ply.nodes, **options)
    return drape.displacement(ply.nodes, x)


def rolled(X):
    """Points of the flat ply on a cylinder of `RADIUS`, whose axis is y."""
    angle = X[0] / RADIUS
    return np.array([RADIUS * np.sin(angle), X[1], RADIUS * (np.cos(angle) - 1)])


def rolled_ply(n, turn=0.0, mesh=MeshQuad):
    """A ply of 100 mm × 100 mm on this cylinder, warp rotated from x."""
    mesh = mesh.init_tensor(*2 * [np.linspace(0, 100, n + 1)])
    c, s = np.cos(turn), np.sin(turn)
    fabric = Fabric(1e4, 0.1, warp=(c, s), weft=(-s, c))
    formulation = Quadratic() if isinstance(mesh, MeshTri) else Macro()
    ply = Ply(mesh, fabric, formulation, dimension=3)
    return ply, drape.displacement(ply.nodes, rolled(ply.nodes))


def case_of(scene, bending=0.0, stretch=1e4, **options):
    """A case of a scene, in one step by default."""
    stiffness = {"bending": (bending, bending)}
    fabric = Fabric(stretch, 0.1, scene.warp, scene.weft, **stiffness)
    return Case(**{"scene": scene, "fabric": fabric, "steps": 1} | options)


# The Chebyshev net of a sphere, with great circles through the pole as first threads

#: The sphere with its pole at the origin, and the side of the quarter ply in mm.
SPHERE, SIDE = drape.Sphere(100.0, (0.0, 0.0, -100.0)), 100.0


def chebyshev(formulation, cells, stretch=1e5, shear=0.1, tension=2.0):
    """A quarter ply that tension keeps in the net, its conditions, and its geodesics.

    ``cells`` are the user's elements per side.
    """
    scene = _quarter(cells, tension)
    fabric = Fabric(stretch, shear, scene.warp, scene.weft)
    ply = Case(scene=scene, fabric=fabric, formulation=formulation).ply()
    return ply, scene.conditions, geodesic_u(ply, SPHERE)


@cache
def _quarter(cells, tension):
    sides = {"width": 2 * SIDE, "height": 2 * SIDE, "size": (cells, cells)}
    return hemisphere("aligned", **sides, tension=tension)


def exact_shear_angle(X):
    """Shear angle in radians at points of the flat ply, shape (2, ...)."""
    return shear_angle(X[0] * X[1] / SIDE**2)


def shear_error(ply, u):
    """Largest error of the shear angle at the centres of elements in degrees."""
    centres = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
    off = ply.shear_angle(u, ply.centre)[:, 0] - exact_shear_angle(centres)
    return np.degrees(np.abs(off).max())


@cache
def _net_spline():
    n = 100
    net = drape.net(SPHERE, SIDE / n, (0, n), (0, n))
    s = np.linspace(0, SIDE, n + 1)
    return RegularGridInterpolator((s, s), np.moveaxis(net.positions, 0, -1), "cubic")


def on_net(X):
    """Points of the flat ply in the net."""
    return _net_spline()(X.T).T


# Tools of triangles, their files, and runs of the command line on them


SMALL = "--size", "4x4", "--steps", "1", "--no-render"

#: Fibres with bending stiffness, without tension: no time for a net.
BENT = "--tension", "0", "--set", "bending.warp_N_mm=5", "bending.weft_N_mm=5"


def write(file, x, triangles):
    meshio.write_points_cells(file, np.transpose(x), [("triangle", triangles.T)])
    return file


def write_sphere(file, n=2502, radius=100.0, centre=(13.0, -7.0, 40.0)):
    """A sphere of 2n − 4 triangles, as an STL file."""
    x, t = sphere(n)
    return write(file, radius * x + np.array(centre)[:, None], t)


def bump_height(x, y):
    return 30 * np.exp(-((x - 5) ** 2 + 1.5 * y**2) / 3200)


def plate(side=100.0, n=29, height=bump_height):
    """Points and triangles of a tool z = h(x, y) over a square."""
    return graph(np.linspace(-side, side, n), height)


def run_words(out, *options, tool):
    """Words of the command that runs a small ply on a tool."""
    words = "run", "drape", "--tool", str(tool), *SMALL, *BENT, *options
    return [*words, "--out", str(out)]


def command(out, *options, tool):
    return cli.main(run_words(out, *options, tool=tool))


def summary(out):
    return json.loads((out / "summary.json").read_text())
