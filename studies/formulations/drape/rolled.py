"""Plies rolled onto a cylinder and a cone, with zero exact shear.

Elements with straight sides between generators of the surface are plane: the ply is a
row of plane strips without strain.  This requires mesh lines along the generators and
loads in the planes of the strips.
"""

from dataclasses import replace

import numpy as np
from numpy import ndarray
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, OnSurface, Ply, Surface, Traction, drape
from skfem_textile.ply.terms import Formulation
from skfem_textile.solve.conditions import Conditions

#: Radius of the cylinder in mm, half angle of the cone in radians, distance of the ply
#: from the tip and side of the ply in mm.
RADIUS, CONE_ANGLE, FROM_TIP, SIDE = 60.0, 0.4, 150.0, 100.0

#: Surfaces and orientations of rolled plies.
CYLINDER, BIAS = "cylinder, 0/90", "cylinder, ±45"
FAN, SQUARES = "cone, a fan of elements", "cone, square elements"
SURFACES = CYLINDER, BIAS, FAN, SQUARES

# Angle of the fan in radians: its mid-width equals its length.
_FAN_ANGLE = 0.5

_CYLINDER = drape.Cylinder(RADIUS, (0, 0, -RADIUS))
_TIP = np.array([-FROM_TIP, 0.0, 0.0])
_CONE = drape.Cone(CONE_ANGLE, _TIP, (np.cos(CONE_ANGLE), 0.0, -np.sin(CONE_ANGLE)))


def problem(
    how: str,
    formulation: Formulation,
    cells: int,
    strips: int,
    tension: float = 0.0,
    stretch: float = 1e5,
    shear: float = 0.1,
) -> tuple[Ply, Conditions, Surface, ndarray]:
    """The ply, its conditions, the surface, and the exact positions as initial guess.

    Parameters
    ----------
    how
        One of `SURFACES`.
    formulation
        The formulation.
    cells, strips
        Elements per side of the user's mesh and of the working mesh.
    tension
        Tension in N/mm on all sides that are not planes of symmetry; 0 for square
        elements on the cone.
    stretch, shear
        Stiffnesses E and G in N/mm.
    """
    s = np.linspace(0, SIDE, cells + 1)
    mesh = MeshQuad.init_tensor(s, s).with_defaults()
    if how == FAN:
        r, polar = FROM_TIP + mesh.p[0], _FAN_ANGLE / SIDE * mesh.p[1]
        fan = np.array([r * np.cos(polar) - FROM_TIP, r * np.sin(polar)])
        mesh = replace(mesh, doflocs=fan)
    surface: Surface = _CONE if how in (FAN, SQUARES) else _CYLINDER
    conditions: dict[str, Condition | OnSurface] = {
        "on": OnSurface(surface),
        "y": Condition("bottom", (None, 0.0, None)),
    }
    if surface is _CYLINDER:
        conditions["x"] = Condition("left", (0.0, None, None))
    elif how == SQUARES:
        conditions["held"] = Condition(lambda X: np.hypot(*X) < 1e-9)
    loads: list[Traction] = []
    if tension and how == FAN:
        loads = _on_fan(tension, cells, strips)
    elif tension:
        chord = SIDE / strips * np.exp(tension / stretch)
        loads = _on_strips(tension, chord, strips)
    c, a = (np.sqrt(0.5), np.sqrt(0.5)) if how == BIAS else (1.0, 0.0)
    fabric = Fabric(stretch, shear, warp=(c, a), weft=(-a, c))
    ply = Ply(mesh, fabric, formulation, loads, dimension=3)
    position = _on_cylinder if surface is _CYLINDER else _on_cone
    return ply, conditions, surface, drape.displacement(ply.nodes, position(ply.nodes))


def pressure(how: str, tension: float, X: ndarray) -> ndarray:
    """Exact contact pressure in N/mm² at points of the flat ply, shape (2, ...)."""
    if how in (CYLINDER, BIAS):
        return np.full(X.shape[1:], tension / RADIUS)
    return tension / (np.hypot(X[0] + FROM_TIP, X[1]) * np.tan(CONE_ANGLE))


def _on_cylinder(X: ndarray) -> ndarray:
    angle = X[0] / RADIUS
    return np.array([RADIUS * np.sin(angle), X[1], RADIUS * (np.cos(angle) - 1)])


def _on_cone(X: ndarray) -> ndarray:
    """Positions on the cone, which touches the plane of the ply along the x axis."""
    r, angle = np.hypot(X[0] + FROM_TIP, X[1]), _polar(X) / np.sin(CONE_ANGLE)
    return r * _generator(angle) + _TIP[:, None]


def _generator(angle: ndarray) -> ndarray:
    """Unit vector along the generator at an angle around the axis of the cone."""
    c, s = np.cos(CONE_ANGLE), np.sin(CONE_ANGLE)
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([c * c + s * s * cosine, s * sine, -c * s + s * c * cosine])


def _on_strips(tension: float, chord: float, strips: int) -> list[Traction]:
    """Loads on a cylinder: last strip circumferentially, all strips axially."""
    angle = 2 * (strips - 0.5) * np.arcsin(chord / (2 * RADIUS))
    across = tension * np.cos(angle), 0.0, -tension * np.sin(angle)
    return [Traction("right", across), Traction("top", (0.0, tension, 0.0))]


def _on_fan(tension: float, cells: int, strips: int) -> list[Traction]:
    """Loads on a fan, in the planes of its strips."""
    step = _FAN_ANGLE / strips
    around = 2 * np.arcsin(np.sin(0.5 * step) / np.sin(CONE_ANGLE))

    def turned(X: ndarray, polar: ndarray | float) -> ndarray:
        """Traction at a polar angle of the flat ply, in the strip of a point."""
        strip = np.floor(_polar(X) / step).clip(0, strips - 1)
        sides = _generator(around * strip), _generator(around * (strip + 1))
        radial, chord = (
            a / np.linalg.norm(a, axis=0)
            for a in (sides[0] + sides[1], sides[1] - sides[0])
        )
        off = polar - (strip + 0.5) * step
        return tension * (np.cos(off) * radial + np.sin(off) * chord)

    def across(X: ndarray) -> ndarray:
        angle = _FAN_ANGLE / cells
        element = np.floor(_polar(X) / angle).clip(0, cells - 1)
        return turned(X, (element + 0.5) * angle)

    return [
        Traction("right", across),
        Traction("left", lambda X: -across(X)),
        Traction("top", lambda X: turned(X, _FAN_ANGLE + 0.5 * np.pi)),
    ]


def _polar(X: ndarray) -> ndarray:
    """Polar angle of points of the flat ply about the tip."""
    return np.arctan2(X[1], X[0] + FROM_TIP)
