"""Scene `specimen`: a ply with user-defined displacement conditions."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from skfem import Mesh

from ..declarations import scenes as declared
from ..mesh.checks import MeshError
from ..mesh.selection import named_nodes
from ..mesh.user_input import printable
from ..solve.conditions import Condition
from .rectangle import given_or_rectangle
from .scene import Scene, with_parameters
from .shear_test import BiasTest

#: Sides of a generated ply in mm.
WIDTH, HEIGHT = declared.Specimen.width, declared.Specimen.height

#: A component of a displacement in mm, or `FREE`.
Component: TypeAlias = float | str

#: Free component.
FREE = "free"

# Tolerance of a rectangular outline at the origin, relative to its size.
_OFF = 1e-6


@with_parameters(declared.Specimen)
def specimen(given: declared.Specimen) -> Scene:
    """Ply with fixed or displaced boundaries, without an exact solution.

    Parameters
    ----------
    mesh
        A mesh, or the kind of `rectangle` to generate, with its lower left corner at
        the origin.
    size, jitter, seed
        As for `rectangle`.
    width, height
        Sides of a generated mesh in mm.
    warp, weft
        Inclination of the fibres in radians.
    moves
        Names of boundaries or nodes, and their final displacements along x and y in mm;
        ``"free"`` for a free component.
    driven
        Name of the boundary or node with the reported reaction; by default with the
        largest displacement.

    Raises
    ------
    ValueError
        If the mesh is not valid or has no such boundary, a side is not positive, no
        displacement is prescribed, a displacement is not finite, or ``driven`` does not
        move.

    Examples
    --------
    >>> scene = specimen(moves=[("bottom", (0, 0)), ("top", ("free", 40))])
    >>> scene.driven, scene.conditions["top"].value
    ('top', (None, 40.0))
    """
    warp, weft, moves = given.warp, given.weft, given.moves
    mesh = given_or_rectangle(given, given.width, given.height, warp, weft)
    conditions = {}
    for name, components in moves:
        if name in conditions:
            raise ValueError(
                f"specimen: the displacement of {name!r} is given twice: omit one of "
                "them"
            )
        if condition := _condition(mesh, name, components):
            conditions[name] = condition
    return Scene(
        name="specimen",
        mesh=mesh,
        warp=(float(np.cos(warp)), float(np.sin(warp))),
        weft=(float(np.cos(weft)), float(np.sin(weft))),
        conditions=conditions,
        driven=_driven(moves, conditions, given.driven),
        misfit="the displacements are user-defined",
        shear_test=_bias_test(mesh, warp, weft, dict(moves)),
    )


def _condition(
    mesh: Mesh, name: str, components: tuple[Component, Component]
) -> Condition | None:
    """Condition of a boundary; None if all components are free."""
    known = [*(mesh.boundaries or {}), *named_nodes(mesh)]
    if name not in known:
        raise MeshError(
            f"specimen: the mesh has no boundary {name!r}: its boundaries are "
            f"{', '.join(map(repr, known)) or 'not named'}"
        )
    for component in components:
        if component != FREE and not np.isfinite(_number(name, component)):
            raise ValueError(
                f"specimen: the displacement of {name!r} must be finite, got "
                f"{component} mm"
            )
    given = tuple(None if c == FREE else _number(name, c) for c in components)
    return None if given == (None, None) else Condition(name, given)


def _number(name: str, component: Component) -> float:
    if isinstance(component, str):
        raise ValueError(
            f"specimen: the displacement of {name!r} must be a number or {FREE!r}, got "
            f"{component!r}"
        )
    return float(component)


def _driven(
    moves: Sequence[tuple[str, tuple[Component, Component]]],
    conditions: dict[str, Condition],
    named: str | None,
) -> str:
    """Name of the condition with the reported reaction."""
    if not conditions:
        raise ValueError(
            "specimen: no boundary has a prescribed displacement: prescribe at least "
            "one"
        )
    if named is not None:
        if named not in conditions:
            raise ValueError(
                f"specimen: the driven boundary {printable(named)!r} has no prescribed "
                f"displacement: choose one of {', '.join(conditions)}"
            )
        return named

    def length(name: str) -> float:
        x, y = (0.0 if c == FREE else float(c) for c in dict(moves)[name])
        return float(np.hypot(x, y))

    return max(conditions, key=length)


def _bias_test(
    mesh: Mesh,
    warp: float,
    weft: float,
    moves: Mapping[str, tuple[Component, Component]],
) -> BiasTest | None:
    """The bias test represented by outline, fibres and clamps, or None."""
    width, height = np.ptp(mesh.p, axis=1).tolist()
    theta = warp % np.pi
    mirrored = abs(theta + weft % np.pi - np.pi) < _OFF and 0 < theta < np.pi / 2
    clamped = set(moves) == {"bottom", "top"} and moves["top"][0] == 0
    if not (mirrored and clamped and tuple(moves["bottom"]) == (0, 0)):
        return None
    if moves["top"][1] == FREE:
        return None
    high_enough = height >= 2 * width * np.tan(theta) * (1 - _OFF)
    full = all(_spans(mesh, name, width) for name in moves)
    return BiasTest(width, height, theta) if high_enough and full else None


def _spans(mesh: Mesh, name: str, width: float) -> bool:
    """True if a boundary extends from side to side."""
    edges = (mesh.boundaries or {}).get(name, ())
    x = mesh.p[0, mesh.facets[:, edges]]
    return x.size > 0 and bool(np.ptp(x) > (1 - _OFF) * width)
