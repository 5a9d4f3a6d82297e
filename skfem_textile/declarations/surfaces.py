"""Parameters of the analytical surfaces.

Positions are in mm, directions of any length.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, TypeAlias

from .fields import DEGREES, MM, REQUIRED, Declared, InFile, about

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    Vector: TypeAlias = ArrayLike
else:
    Vector = tuple[float, float, float]

_REQUIRED = InFile(REQUIRED)

_ORIGIN, _UP = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)

_Point = Annotated[Vector, MM, about("point of the surface or of its axis")]

_Axis = Annotated[Vector, about("direction of the axis")]

_Radius = Annotated[float, MM, about("radius")]


@dataclass(frozen=True, eq=False)
class Plane(Declared, module="drape.surfaces"):
    """plane"""

    point: _Point = _ORIGIN
    normal: Annotated[Vector, about("normal of any length")] = _UP


@dataclass(frozen=True, eq=False)
class Sphere(Declared, module="drape.surfaces"):
    """sphere"""

    radius: _Radius
    centre: Annotated[Vector, MM, _REQUIRED, about("centre of the sphere")] = _ORIGIN


@dataclass(frozen=True, eq=False)
class Cylinder(Declared, module="drape.surfaces"):
    """cylinder"""

    radius: _Radius
    point: Annotated[_Point, _REQUIRED] = _ORIGIN
    axis: _Axis = (0.0, 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class Cone(Declared, module="drape.surfaces"):
    """cone"""

    angle: Annotated[float, DEGREES, about("angle between axis and surface")]
    point: Annotated[Vector, MM, _REQUIRED, about("apex")] = _ORIGIN
    axis: Annotated[Vector, about("direction from the apex into the cone")] = _UP


@dataclass(frozen=True, eq=False)
class Torus(Declared, module="drape.surfaces"):
    """torus"""

    radius: Annotated[float, MM, about("radius of the centre line of the tube")]
    tube: Annotated[float, MM, about("radius of the tube")]
    point: Annotated[Vector, MM, _REQUIRED, about("centre")] = _ORIGIN
    axis: _Axis = _UP


@dataclass(frozen=True, eq=False)
class Punch(Declared, module="drape.punch_and_die"):
    """shaft with a hemispherical end"""

    radius: Annotated[float, MM, about("radius of the shaft and of the hemisphere")]
    point: Annotated[Vector, MM, _REQUIRED, about("centre of the hemisphere")] = _ORIGIN
    axis: Annotated[Vector, about("direction from the shaft to the tip")] = _UP


@dataclass(frozen=True, eq=False)
class Die(Declared, module="drape.punch_and_die"):
    """plane with a round hole and a fillet"""

    radius: Annotated[float, MM, about("radius of the hole")]
    fillet: Annotated[float, MM, about("radius of the fillet")]
    point: Annotated[Vector, MM, about("centre of the hole in the plane")] = _ORIGIN
    axis: Annotated[Vector, about("direction from the plane into the hole")] = _UP
