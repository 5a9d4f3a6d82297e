"""The condition that nodes lie on a surface."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from ...mesh.bases import node_positions
from ...mesh.selection import Where, selected_nodes
from .asked import Asked
from .surface import Grown, Surface
from .surface_check import check_derivatives

# Distance of the surface from the plane of the ply where they touch, as a share of the
# largest coordinate, and the sine of the angle between them, that count as none.
# Chosen: above what meshes of surfaces are rounded to.
_TOUCHING = 1e-4


@dataclass(frozen=True, eq=False)
class OnSurface:
    """Nodes lie on a surface, along which they move freely.

    With the load factor the surface grows out of the plane of the ply: at the load
    factor t it is the surface enlarged by 1/t about the point where it touches the
    plane z = 0.  At 1 it is the surface as it is, and need not touch that plane.

    Parameters
    ----------
    surface
        The surface.
    where
        The nodes, as for `Condition`; all nodes if not given.
    touch
        x and y of the point in mm where the surface touches the plane of the ply.

    Examples
    --------
    A square ply grows onto a sphere of the radius 100 mm, its first node held at the
    pole and its lower edge in a plane of symmetry:

    >>> import numpy as np
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Condition, Fabric, LoadStepper, OnSurface, Ply, drape
    >>> mesh = MeshQuad().refined(2).scaled(60.0).with_defaults()
    >>> ply = Ply(mesh, Fabric(1e4, 0.1), dimension=3)
    >>> conditions = {
    ...     "tool": OnSurface(drape.Sphere(100.0, (0, 0, -100))),
    ...     "x": Condition("left", (0.0, None, None)),
    ...     "y": Condition("bottom", (None, 0.0, None)),
    ... }
    >>> result = LoadStepper(ply, conditions, 1).run()
    >>> x = np.pad(ply.nodes, ((0, 1), (0, 0))) + ply.nodal(result.u)
    >>> bool(np.allclose(np.linalg.norm(x + [[0], [0], [100]], axis=0), 100))
    True
    """

    surface: Surface
    where: Where | None = None
    touch: tuple[float, float] = (0.0, 0.0)

    def nodes(self, name: str, basis: CellBasis) -> ndarray:
        """Numbers of the nodes on the surface, ascending.

        Raises
        ------
        ValueError
            If the nodes are not valid, or there are none.
        """
        if self.where is None:
            return np.arange(node_positions(basis).shape[1])
        return np.unique(selected_nodes(f"condition {name!r}", self.where, basis))

    def check(self, name: str, x: ndarray) -> None:
        """Refuse what is no surface at points, shape (3, n).

        Raises
        ------
        ValueError
            If a method is missing, fails, gives arrays of another shape, or
            contradicts another.
        """
        methods = "level", "gradient", "hessian"
        if isinstance(self.surface, type) or not all(
            hasattr(self.surface, method) for method in methods
        ):
            raise ValueError(
                f"condition {name!r}: a surface must be like drape.Sphere(100.0), with "
                f"{', '.join(methods)}, not {self.surface!r}"
            )
        surface = Asked(name, self.surface)
        for method in methods:
            getattr(surface, method)(x)
        check_derivatives(name, surface, x)

    def at(self, name: str, t: float) -> Surface:
        """The surface at a load factor.

        Raises
        ------
        ValueError
            If it is still to grow, and fails or does not touch the plane of the ply.
        """
        if t == 1:
            return self.surface
        point = np.array([*self.touch, 0.0])
        if off := _off_plane(Asked(name, self.surface), point):
            raise ValueError(
                f"condition {name!r}: the surface cannot grow out of the ply, for it "
                f"does not touch the plane z = 0 at {self.touch}, where it {off}: move "
                "it, give another point as touch, or start from positions on it with "
                "equilibrium_near"
            )
        return Grown(self.surface, point, t)


def _off_plane(surface: Surface, point: ndarray) -> str:
    """What keeps a surface from touching the plane z = 0 at a point, if it does not."""
    level = float(surface.level(point[:, None])[0])
    normal = surface.gradient(point[:, None])[:, 0]
    length = float(np.linalg.norm(normal))
    if not (np.isfinite(level) and 0 < length < np.inf):
        return "has no tangent plane"
    gap, sine = abs(level) / length, float(np.hypot(*normal[:2])) / length
    if gap > _TOUCHING * max(1.0, float(np.abs(point).max())):
        return f"is {gap:.3g} mm away"
    if sine > _TOUCHING:
        return f"is inclined by {np.degrees(np.arcsin(min(sine, 1.0))):.2g}°"
    return ""
