"""Parameters of the analytical surfaces.

Positions are in mm, directions of any length.
"""

from typing import TYPE_CHECKING, TypeAlias

from . import REQUIRED, declaration, deg, key, mm

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    Vector: TypeAlias = ArrayLike
else:
    Vector = tuple[float, float, float]

_ORIGIN, _UP = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)


@declaration("surfaces.analytic", eq=False)
class Plane:
    """plane"""

    point: Vector = mm("point of the surface or of its axis", default=_ORIGIN)
    normal: Vector = key("normal of any length", default=_UP)


@declaration("surfaces.analytic", eq=False)
class Sphere:
    """sphere"""

    radius: float = mm("radius")
    centre: Vector = mm("centre of the sphere", default=_ORIGIN, in_file=REQUIRED)


@declaration("surfaces.analytic", eq=False)
class Cylinder:
    """cylinder"""

    radius: float = mm("radius")
    point: Vector = mm(
        "point of the surface or of its axis", default=_ORIGIN, in_file=REQUIRED
    )
    axis: Vector = key("direction of the axis", default=(0.0, 1.0, 0.0))


@declaration("surfaces.analytic", eq=False)
class Cone:
    """cone"""

    angle: float = deg("angle between axis and surface")
    point: Vector = mm("apex", default=_ORIGIN, in_file=REQUIRED)
    axis: Vector = key("direction from the apex into the cone", default=_UP)


@declaration("surfaces.analytic", eq=False)
class Torus:
    """torus"""

    radius: float = mm("radius of the centre line of the tube")
    tube: float = mm("radius of the tube")
    point: Vector = mm("centre", default=_ORIGIN, in_file=REQUIRED)
    axis: Vector = key("direction of the axis", default=_UP)


@declaration("surfaces.punch_and_die", eq=False)
class Punch:
    """shaft with a hemispherical end"""

    radius: float = mm("radius of the shaft and of the hemisphere")
    point: Vector = mm("centre of the hemisphere", default=_ORIGIN, in_file=REQUIRED)
    axis: Vector = key("direction from the shaft to the tip", default=_UP)


@declaration("surfaces.punch_and_die", eq=False)
class Die:
    """plane with a round hole and a fillet"""

    radius: float = mm("radius of the hole")
    fillet: float = mm("radius of the fillet")
    point: Vector = mm("centre of the hole in the plane", default=_ORIGIN)
    axis: Vector = key("direction from the plane into the hole", default=_UP)
