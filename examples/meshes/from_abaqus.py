"""From a deck of Abaqus to a figure: mesh, fibre directions and fabric of one file.

The deck is written here: a ply of 50 × 100 mm whose fibres follow a reference curve,
and test data of its fabric.  It is read, looked at, pulled, and handed over again.
"""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

from skfem_textile import Condition, Fabric, LoadStepper, Ply
from skfem_textile.fabric.directions import (
    AlongCurve,
    directions_of,
    directions_warning,
)
from skfem_textile.io import (
    read_directions,
    read_fabric,
    read_mesh,
    write_directions,
    write_draped,
)
from skfem_textile.scenes.rectangle import rectangle

FABRIC = """*MEMBRANE SECTION, ELSET=PLY, MATERIAL=CLOTH
0.3,
*MATERIAL, NAME=CLOTH
*DENSITY
1.6e-9,
*FABRIC
*UNIAXIAL, COMPONENT=1
** fill: nominal stress in N/mm2, nominal strain
*LOADING DATA, DIRECTION=TENSION, EXTRAPOLATION=LINEAR
0., 0.
12., 0.004
80., 0.008
600., 0.02
*UNIAXIAL, COMPONENT=2
*LOADING DATA, DIRECTION=TENSION, EXTRAPOLATION=LINEAR
0., 0.
40., 0.004
160., 0.008
700., 0.02
*UNIAXIAL, COMPONENT=SHEAR
** shear stress in N/mm2, drop of the angle between fill and warp in radians
*LOADING DATA, EXTRAPOLATION=LINEAR
0., 0.
0.05, 0.3
0.2, 0.6
0.8, 0.9
"""


def write_deck(path):
    """A deck whose warp is at 45° to a curve."""
    mesh = rectangle(50.0, 100.0, (8, 16), "irregular", 0.2, 1)
    height = np.linspace(0.0, 100.0, 50)
    curve = np.stack([25 + 6 * np.sin(np.pi * height / 100), height])
    along = Fabric(
        warp=AlongCurve(curve, -np.pi / 4), weft=AlongCurve(curve, np.pi / 4)
    )
    write_directions(path, mesh, directions_of(mesh, along))
    path.write_text(path.read_text() + FABRIC)


def main():
    deck = Path("cloth.inp")
    write_deck(deck)

    mesh, directions = read_mesh(deck), read_directions(deck)
    fabric, not_taken = read_fabric(deck)
    print(*(f"not taken over: {sentence}" for sentence in not_taken), sep="\n")
    assert directions_warning(mesh, directions) == ""
    if find_spec("pyvista"):
        from skfem_textile.plot import mesh_and_fibres

        mesh_and_fibres(mesh, directions, "mesh_and_fibres.png")

    ply = Ply(mesh, directions.on(fabric))
    pull = {
        "bottom": Condition("bottom", 0.0),
        "top": Condition("top", lambda X, t: t * np.array([[0.0], [12.0]]) + 0 * X),
    }
    result = LoadStepper(ply, pull, steps=6).run()
    print(f"load {result.states[-1].reactions['top'][1]:.2f} N")

    write_draped(result, ".")  # fibres.vtu, fibres.csv, fibres.inp
    warp, weft = read_directions("fibres.inp").angles_deg()
    sheared = 90 - (weft - warp)
    print(f"shear angle of the elements up to {sheared.max():.1f} degrees")
    assert 20 < sheared.max() < 60

    # The first edge of each element is no fibre direction, and that is told.
    edges = mesh.p[:, mesh.t[1]] - mesh.p[:, mesh.t[0]]
    across = np.stack([-edges[1], edges[0]])
    by_accident = type(directions)(edges, across)
    print("warning:", directions_warning(mesh, by_accident))
    assert directions_warning(mesh, by_accident)


if __name__ == "__main__":
    main()
