"""Fields of results and shapes of plies and tools for pictures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy import ndarray
from skfem import AbstractBasis

from ..fabric import Fabric
from ..forms.fields import FabricOnBasis, on_basis
from ..io.results import cell_fields, has_tools, joined, point_fields
from ..mesh.user_input import refuse_unknown, with_article
from ..ply import Ply
from ..solve.result import Result
from ..solve.states import State
from ..surfaces.surface import Surface
from ..surfaces.tool_mesh import triangles_within
from .sheet import LIGHT, Fibres, Scale, Shape, Tool, eye_axes, in_perspective

if TYPE_CHECKING:
    from ..contact import PlacedTool


#: A result; or, as three arguments, a basis, its DOF vector and a fabric.
Drawn: TypeAlias = Result | AbstractBasis | ndarray | Fabric


@dataclass(frozen=True, eq=False)
class Displaced:
    """Fabric on a user's basis in one state, drawn like the result of a run."""

    ply: FabricOnBasis
    u: ndarray
    load_factor: float = 1.0
    parameters: None = None

    @property
    def states(self) -> "list[Displaced]":
        """The state itself."""
        return [self]

    def tool(self, t: float) -> None:
        """None: there is no tool."""


def results_of(drawn: Sequence[Drawn], state: int) -> tuple[list, list]:
    """Results, and the state of each that is drawn.

    A basis, its DOF vector and a fabric, in this order, are one result.
    """
    results: list[Any] = list(drawn)
    if not results:
        raise ValueError(f"nothing to draw: pass at least one result, or {_OF_BASIS}")
    if isinstance(results[0], AbstractBasis):
        if len(results) != len(("basis", "u", "fabric")):
            raise ValueError(
                f"a basis is drawn with its displacement and a fabric: pass {_OF_BASIS}"
            )
        results = [Displaced(*on_basis(*results))]
    for result in results:
        if not hasattr(result, "states"):
            raise ValueError(
                f"pictures require a Result, not {with_article(result)}, or "
                f"{_OF_BASIS}: for a state from equilibrium_near pass "
                "Result.of_state(ply, conditions, state)"
            )
    fewest = min(len(result.states) for result in results)
    if not -fewest <= state < fewest:
        raise ValueError(
            f"there is no state {state}: a result contains {fewest} states"
        )
    return results, [result.states[state] for result in results]


_OF_BASIS = "(basis, u, fabric)"


def refuse_other_than_result(what: str, result: Any) -> None:
    """Refuse what has no states, where a displacement on a basis is not enough."""
    if not hasattr(result, "states"):
        raise ValueError(
            f"{what} requires the Result of a run, not {with_article(result)}: "
            f"plot.field and plot.view draw {_OF_BASIS}"
        )


#: Colour map of fields with a sign.
DIVERGING = "RdBu_r"


@dataclass(frozen=True)
class Field:
    """Quantity with one value per element.

    Attributes
    ----------
    label
        Label of the scale, with the unit.
    values
        Function of a ply and a displacement, ``(ply, u) -> values``, shape
        (n_elements,).
    cmap
        Name of a matplotlib colour map: a sequential one for magnitudes, by default; a
        diverging one for values with a sign.
    signed
        If True, the middle of the colour map is at zero, which is marked on the scale.
        Every scale includes zero.

    Examples
    --------
    >>> wrinkles = Field("Compression of the warp (N/mm)",
    ...     lambda ply, u: -ply.fibre_tension(u)[0].min(axis=-1))
    >>> wrinkles.cmap
    'viridis'
    """

    label: str
    values: Callable[[Any, ndarray], ndarray]
    cmap: str = "viridis"
    signed: bool = False


def _of_family(label: str, factor: float = 1.0) -> Field:
    """Strain or tension of fibres, one of the element fields."""
    name = "_".join(label.lower().split()[:2])
    return Field(
        label, lambda ply, u: factor * cell_fields(ply, u)[name], DIVERGING, signed=True
    )


def _mean_displacement(ply: FabricOnBasis, u: ndarray) -> ndarray:
    """Mean displacement of the vertices of each element."""
    displacement = point_fields(ply, u)["displacement"]
    return np.linalg.norm(displacement[ply.mesh.t].mean(axis=0), axis=1)


def _slip_index(ply: Any, u: ndarray) -> ndarray:
    from ..ply.slip import slip_index

    return 100 * slip_index(ply, u)


#: Fields by name.
FIELDS: Mapping[str, Field] = {
    "shear_angle": Field(
        "Shear angle (°)",
        lambda ply, u: cell_fields(ply, u)["shear_angle"],
        DIVERGING,
        signed=True,
    ),
    "warp_strain": _of_family("Warp strain (%)", 100),
    "weft_strain": _of_family("Weft strain (%)", 100),
    "warp_tension": _of_family("Warp tension (N/mm)"),
    "weft_tension": _of_family("Weft tension (N/mm)"),
    "displacement": Field("Displacement (mm)", _mean_displacement, "cividis"),
    "slip_index": Field("Slip index (%)", _slip_index, "cividis"),
    "area_ratio": Field(
        "Area relative to initial area",
        lambda ply, u: ply.least_area_ratio(u),
        "cividis",
    ),
}


def field_of(field: str | Field) -> Field:
    """Look up a field by name; a `Field` is returned unchanged."""
    if isinstance(field, Field):
        return field
    refuse_unknown("field", field, FIELDS)
    return FIELDS[field]


def values_of(field: Field, ply: FabricOnBasis, u: ndarray) -> ndarray:
    """Values of a field; refused unless one finite number per element."""
    values = np.asarray(field.values(ply, u), dtype=float)
    if values.shape != (ply.mesh.nelements,):
        raise ValueError(
            f"{field.label}: expected one value for each of the {ply.mesh.nelements} "
            f"elements, got an array of shape {values.shape}"
        )
    if not np.isfinite(values).all():
        element = int(np.flatnonzero(~np.isfinite(values))[0])
        raise ValueError(f"{field.label}: the value in element {element} is not finite")
    return values


def reach(fields: Sequence[ndarray]) -> tuple[float, float]:
    """Limits of a scale that includes all fields and zero."""
    low = min((float(x.min()) for x in fields), default=0.0)
    high = max((float(x.max()) for x in fields), default=0.0)
    return min(low, 0.0), max(high, 0.0)


# Chosen by eye: margin of a tool beyond the ply relative to the diagonal of the ply's
# box; number of cubes along the longest side of this box; darkest and lightest grey.
_BEYOND, _CUBES, _GREYS = 0.17, 56, (0.58, 0.93)


def tool_under(points: ndarray, surface: Surface) -> Tool:
    """Part of a tool near a ply, given the corners of its elements, (n, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    beyond = _BEYOND * np.linalg.norm(high - low)
    x, triangles, normal = triangles_within(
        surface, low - beyond, high + beyond, _CUBES
    )
    return Tool(x.T, triangles, shades_of(normal))


def shades_of(normal: ndarray) -> ndarray:
    """Grey levels of facets with normals of any length, shape (3, n)."""
    normal = eye_axes(on_tool=True) @ normal
    normal = normal / np.linalg.norm(normal, axis=0)
    light = np.array(LIGHT) / np.linalg.norm(LIGHT)
    lit = np.clip(light @ (normal * np.copysign(1.0, normal[2])), 0.0, 1.0)
    return _GREYS[0] + (_GREYS[1] - _GREYS[0]) * lit


def _tools_between(
    results: Sequence[Result], states: Sequence[State]
) -> dict[int, tuple[Tool | None, Tool | None]]:
    """Tools behind formed plies and in front of them, by number of the state.

    They stand where they are in the state.  The states of one ply are seen in the same
    box.
    """
    numbers: dict[Ply, list[int]] = {}
    for i, result in enumerate(results):
        if has_tools(result.ply):
            numbers.setdefault(result.ply, []).append(i)
    tools = {}
    for ply, of_ply in numbers.items():
        from ..contact import box_of, placed_tools

        box = box_of(ply, [states[i] for i in of_ply])
        placed = placed_tools(ply, [states[i] for i in of_ply], *box)
        for i, at in zip(of_ply, placed, strict=True):
            behind = [tool for tool in at if _faces_viewer(tool)]
            in_front = [tool for tool in at if not _faces_viewer(tool)]
            tools[i] = _joined(behind, True), _joined(in_front, False)
    return tools


def _faces_viewer(tool: "PlacedTool") -> bool:
    """True if a tool faces the viewer as a whole, so that the ply is in front of it.

    Of a die above the ply the far wall of its hole faces the viewer, but hides the ply.
    """
    a, b, c = tool.points[:, tool.triangles].swapaxes(0, 1)
    area = np.cross(b - a, c - a, axis=0).sum(axis=1)
    return bool(eye_axes(on_tool=True)[2] @ area > 0)


def _joined(tools: Sequence["PlacedTool"], one_sided: bool) -> Tool | None:
    if not tools:
        return None
    points, triangles = joined(tools)
    shades = shades_of(np.hstack([tool.normals for tool in tools]))
    return Tool(points.T, triangles, shades, one_sided)


def solids_of(
    results: Sequence[Result], states: Sequence[State], veiled: bool = False
) -> list[Shape]:
    """Plies of results, each in one state, with straight edges between the vertices.

    With the tools on which they lie, and of those between which they are formed the
    tools behind the ply, and if ``veiled`` also those in front of it.
    """
    shapes, tools = [], _tools_between(results, states)
    for i, (result, at) in enumerate(zip(results, states, strict=True)):
        shape = Shape.of(result.ply.mesh, result.ply.nodal(at.u))
        if surface := result.tool(at.load_factor):
            shape = shape._replace(tool=tool_under(shape.points, surface))
        elif i in tools:
            behind, in_front = tools[i]
            shape = shape._replace(tool=behind, veil=in_front if veiled else None)
        shapes.append(shape)
    return shapes


def shapes_of(
    results: Sequence[Result], states: Sequence[State], veiled: bool = False
) -> list[Shape]:
    """Plies and tools as seen: in perspective if at least one ply is in space.

    Of tools between which a ply is formed only the faces towards the viewer are drawn.
    """
    shapes = solids_of(results, states, veiled)
    in_space = any(len(result.ply.nodal(result.u)) == 3 for result in results)
    return in_perspective(shapes) if in_space else shapes


def fibres_of(ply: FabricOnBasis) -> Fibres:
    """Fibres of a ply with the vertices of its mesh."""
    shape = 2, ply.mesh.nelements
    directions = (np.broadcast_to(A[..., 0], shape) for A in ply.directions(ply.centre))
    return Fibres.of(ply.mesh.p, (ply.mesh.t,), *directions)


def scale_of(
    field: Field,
    values: Sequence[ndarray],
    cmap: Any = None,
    clim: Sequence[float] | None = None,
) -> Scale:
    """Scale of a field that includes all values; a given map is used as a whole."""
    signed = field.signed and cmap is None
    return Scale.of(field.label, reach(values), cmap or field.cmap, clim, signed)
