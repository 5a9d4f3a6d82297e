"""A small hemisphere that is formed, completely and half way, and files of tools."""

from functools import cache

import meshio
import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Holder,
    LoadStepper,
    Macro,
    Newton,
    Ply,
    StepError,
    Tool,
    Traction,
    drape,
)
from skfem_textile.io import read_surface

from . import graph

SIDE, RADIUS, GAP = 60.0, 30.0, 0.3
MIRRORS = {"left": "mirror", "bottom": "mirror"}


SYMMETRY = {
    "x": Condition("left", (0.0, None, None)),
    "y": Condition("bottom", (None, 0.0, None)),
}


def blank(cells=3, fibres=0.0, terms=(), formulation=None, bending=5.0, tension=0.2):
    """Quarter of a blank with two planes of symmetry."""
    s = np.linspace(0, SIDE, cells + 1)
    mesh = MeshQuad.init_tensor(s, s).with_defaults()
    c, n = np.cos(fibres), np.sin(fibres)
    fabric = Fabric(1e4, 0.1, (c, n), (-n, c), bending=(bending, bending))
    loads = [
        Traction("right", (tension, 0, 0), factor=1.0),
        Traction("top", (0, tension, 0), factor=1.0),
    ]
    return Ply(
        *(mesh, fabric, formulation or Macro()),
        terms=[*loads, *terms],
        dimension=3,
        fibre_ends=MIRRORS,
    )


def over_punch(motion, cells=4):
    """Ply over a hemispherical punch, on a plate that holds it down."""
    t = np.linspace(0, 2 * np.pi, 41)
    ring = np.hstack([r * np.array([np.cos(t), np.sin(t)]) for r in (200.0, 38.0)])
    punch = Tool(drape.Sphere(RADIUS, (0, 0, -RADIUS - GAP / 2)), motion, name="punch")
    plate = drape.Plane((0, 0, GAP / 2))
    die = Tool(plate, side=-1, outline=ring, name="die")
    holder = Holder(plate, gap=GAP, side=-1, outline=ring, name="holder")
    return blank(cells, terms=[punch, die, holder]), SYMMETRY


@pytest.fixture(scope="session")
def hemisphere():
    """Formed to 15 mm in three steps."""
    return _formed()


@cache
def _formed():
    return LoadStepper(*over_punch((0.0, 0.0, 15.0)), steps=3).run()


@pytest.fixture(scope="session")
def stopped():
    """Run that stops at 5 of 35 mm: 20 iterations are too few for a step of 30 mm."""

    def motion(t):
        return 0.0, 0.0, 10 * t if t <= 0.5 else 5 + 60 * (t - 0.5)

    few = Newton(most=2)
    with pytest.raises(StepError) as caught:
        LoadStepper(*over_punch(motion, 3), steps=2, max_halvings=0, method=few).run()
    return caught.value


# Tools from files


def bowl(path, height, offset=0.0, side=60.0, n=21):
    """Write a shallow dome as STL, its top at the offset."""
    s = np.linspace(-side, side, n)

    def shape(x, y):
        return offset - height * (1 - np.exp(-(x**2 + y**2) / 900))

    x, t = graph(s, shape)
    meshio.Mesh(x.T, [("triangle", t.T)]).write(path)
    return path


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """Punch and die with z = 500 as the lowest point of the die."""
    tmp_path = tmp_path_factory.mktemp("tools")
    punch = bowl(tmp_path / "P.stl", 40.0, 499.5)
    die = bowl(tmp_path / "D.stl", 32.0, 532.0)
    return str(punch), str(die)


@pytest.fixture(scope="session")
def flanged(tmp_path_factory):
    """A dome as punch, and a die with a flat flange outside a radius of 50 mm."""
    tmp_path = tmp_path_factory.mktemp("flanged")
    x, t = graph(
        np.linspace(-60.0, 60.0, 25),
        lambda x, y: 30 * np.cos(np.pi * np.minimum(np.hypot(x, y), 50) / 100) ** 2,
    )
    meshio.Mesh(x.T, [("triangle", t.T)]).write(tmp_path / "flanged.stl")
    punch = bowl(tmp_path / "dome.stl", 40.0, -0.5)
    return read_surface(punch), read_surface(tmp_path / "flanged.stl")
