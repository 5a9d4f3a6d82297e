"""Ply on a tool, draped from its kinematic net.

The equilibrium on the tool is found from the places of the nodes in the net.  Where a
net folds or ends within the ply, the tool grows out of the plane of the ply instead.
The tool touches the ply at its centre, the origin.  A quarter of the ply suffices if
tool and fibres have planes of symmetry, with fibres along the sides or at 45° to them.
Otherwise the whole ply is fixed along x at its centre, and along y at two nodes near
its x axis, one on each side, at positions given by geodesics.  Under edge tension
these nodes have no reactions, see `EdgeTension`.

Inextensible fibres lie on a tool like a kinematic net, whose shear is determined by the
curvature of the tool.  At the corner of a box the total curvature of a right angle is
concentrated in one point, and no net fits around it, of which `warn_of_net` warns
before draping.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Unpack

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..contact.risks import (
    COARSE,
    beyond_edges,
    bridging,
    contact_pressure,
    off_triangles,
    share_of_area,
    turn_of_normal,
)
from ..declarations.scenes import PlyOptions
from ..fabric import Fabric
from ..mesh.checks import MeshError
from ..mesh.user_input import coords
from ..nets.crossings import Net, NetError
from ..ply import Ply
from ..ply.terms import Load
from ..solve.conditions import Condition
from ..solve.on_surface import OnSurface
from ..solve.quantities import Quantity
from ..solve.result import Result, components_mm
from ..surfaces.surface import (
    SAME_AXES,
    Axes,
    Geodesics,
    OffSurfaceError,
    Surface,
    displacement,
    geodesics,
    onto,
)
from .edge_tension import AROUND, CELLS, EdgeTension, edge_net
from .rectangle import flat_ply, half_way, in_planes, misfit
from .scene import Scene, unknown

log = logging.getLogger(__name__)

# Shear angle of a net in degrees, and its change over the length of an element, which
# are reported if both are exceeded.  Measured with 6 to 32 elements along the ply:
# beyond the corners of boxes with walls of 45°, 67° and 78° nets shear by 21°, 52° and
# 72°, with changes of 11° to 24°, 33° to 54° and 51° to 77°.  From the net, plies pass
# the second corner with up to five times as many solves as elsewhere.  On a sphere nets
# shear by up to 72°; above 45° changes are at most 28°.
_MOST_SHEAR, _MOST_CHANGE = 45.0, 30.0

# Tension or stiffness does not help.  Rounding a corner distributes its curvature and
# does not change the shear beyond it.
_ADVICE = (
    "The run may take long or stop: use a ply that ends before that corner, or drape "
    "it in parts"
)


# Figures of `measured_on_tool` that are printed first.
_FIRST = (
    Quantity("Largest tool pressure", "max_contact_pressure_N_per_mm2", "N/mm²"),
    Quantity("Bridging", "bridging_share_of_area", "%", note=" of the area"),
    *(
        Quantity("Note", key)
        for key in (
            *("not_on_tool", "beyond_tool", "off_triangles", "coarse_elements"),
            *("faces_away", "not_the_net"),
        )
    ),
)


def warn_of_net(lay: Callable[[], Net], X: ndarray, axes: Axes) -> None:
    """Warn of a tool on which a net folds, or shears strongly at a corner.

    Parameters
    ----------
    lay
        Function that returns the net on the tool, see `edge_net`.
    X
        Nodes of the flat ply in mm, shape (2, n).
    axes
        Axes of the ply in the axes of the tool, for positions in messages.
    """
    net = lay()
    if net.folds.size:
        log.warning(
            "drape: inextensible fibres cannot lie on this tool, because their net "
            "folds at %s mm. %s",
            coords(axes.of_tool(net.folds[:, :1])[:, 0], 4),
            _ADVICE,
        )
        return
    net = net.up_to(X)
    shear = np.degrees(net.shear_angle())
    cell = np.ptp(X, axis=1).max() / CELLS
    element = np.sqrt(np.ptp(X, axis=1).prod() / X.shape[1])
    over = max(1, round(float(element / cell)))
    change = max(
        np.nan_to_num(np.abs(shear[over:] - shear[:-over])).max(initial=0.0),
        np.nan_to_num(np.abs(shear[:, over:] - shear[:, :-over])).max(initial=0.0),
    )
    shear = np.nan_to_num(np.abs(shear))
    if shear.max() > _MOST_SHEAR and change > _MOST_CHANGE:
        i, j = np.unravel_index(shear.argmax(), shear.shape)
        centre = net.positions[:, i : i + 2, j : j + 2].mean(axis=(1, 2))
        log.warning(
            "drape: inextensible fibres shear by %.0f degrees at %s mm, because the "
            "curvature of this tool is concentrated at a corner. %s",
            shear.max(),
            coords(axes.of_tool(centre[:, None])[:, 0], 4),
            _ADVICE,
        )


# Tolerance of lengths relative to the ply.
_OFF = 1e-6


def draped_ply(
    name: str,
    surface: Surface,
    mesh: str | Mesh,
    *,
    exact: Callable[[ndarray, float], ndarray] = unknown,
    off_exact: Callable[[ndarray], str] = lambda X: "no exact solution is known",
    axes: Axes = SAME_AXES,
    check: Callable[[Mesh, Callable[[], Net]], None] = lambda mesh, lay: None,
    **ply: Unpack[PlyOptions],
) -> Scene:
    """Scene of a ply on a tool.

    Parameters
    ----------
    name
        Name of the scene.
    surface
        The tool, which touches the plane z = 0 at the origin.  For a quarter it must be
        symmetric about the planes x = 0 and y = 0.
    mesh, **ply
        See `flat_ply`.
    exact
        Exact shear angle ``(X, t) -> (n,)`` in radians, or `unknown`.
    off_exact
        Function of the nodes, (2, n): reason why the exact shear angle is not valid;
        empty if it is.
    axes
        Axes of the scene in the axes of the user's tool.
    check
        Called with the mesh and a function that returns the net on the tool.

    Raises
    ------
    ValueError
        See `flat_ply`; also if a whole ply cannot be held on the tool.
    """
    at_rest = flat_ply(name, mesh, **ply)
    flat, angles, tension, held = at_rest
    on_tool = OnSurface(surface, stated=axes.of_tool)

    laid = _Laid(flat, on_tool, tension, angles, held)
    check(flat, laid.lay)
    held_at = in_planes(name, flat) if held else _at_middle(name, flat, on_tool)
    warp, weft = at_rest.fibres
    return Scene(
        name=name,
        mesh=flat,
        warp=warp,
        weft=weft,
        conditions={"tool": on_tool, **held_at},
        driven="tool",
        shear_angle=exact,
        dimension=3,
        fibre_ends=dict.fromkeys(held, "mirror"),
        loads_of=laid.edge_tension,
        figures=partial(shear_errors, exact=exact),
        first=_FIRST,
        measured=partial(measured_on_tool, axes=axes, holding={} if held else held_at),
        misfit=misfit(flat, held) or off_exact(flat.p),
        axes=axes,
        initial_guess=laid.in_net,
    )


@dataclass(frozen=True, eq=False)
class _Laid:
    """Ply on its tool, whose net is laid at first use; see `EdgeTension`."""

    mesh: Mesh
    on_tool: OnSurface
    tension: float
    angles: tuple[float, float]
    held: tuple[str, ...]

    @cached_property
    def _net(self) -> Net:
        beyond = {} if self.tension else {"beyond": AROUND}
        return edge_net(self.mesh, self.on_tool, self.angles, self.held, **beyond)

    def lay(self) -> Net:
        """Net on the tool."""
        return self._net

    def in_net(self, ply: Ply) -> ndarray | None:
        """Displacement to the places of the nodes in the net, if it covers the ply."""
        try:
            x = onto(self.on_tool.surface, self._net.at(ply.nodes))
        except (NetError, OffSurfaceError):  # the net ends within the ply
            return None
        return displacement(ply.nodes, x)

    def edge_tension(self, fabric: Fabric) -> Sequence[Load]:
        """Loads of a ply of a fabric."""
        if not self.tension:
            return []
        law = fabric.shear_law if fabric.at() is fabric else None
        of_ply = self.tension, self.angles, law, self.held, self.lay
        return [EdgeTension(self.on_tool, *of_ply)]


def shear_errors(
    result: Result, exact: Callable[[ndarray, float], ndarray]
) -> dict[str, float]:
    """Deviation of shear angles at the centres of elements from exact ones."""
    X, angle, area = result.at_centres()
    expected = exact(X, result.states[-1].load_factor)
    off = np.degrees(angle - expected)
    return {
        "exact_max_shear_angle_deg": float(np.degrees(np.abs(expected).max())),
        "shear_angle_error_max_deg": float(np.abs(off).max()),
        "shear_angle_error_rms_deg": float(np.sqrt(np.average(off**2, weights=area))),
    }


def _at_middle(name: str, mesh: Mesh, on_tool: OnSurface) -> dict[str, Condition]:
    """Conditions on three nodes of a whole ply, one for each rigid motion on a plane.

    The node nearest to the centre is fixed along x.  The node nearest to the middle of
    the right half of the x axis, and the opposite one on the left, are fixed along y.
    """
    half = half_way(name, mesh)

    def nearest(target: ndarray, among: ndarray) -> ndarray:
        if not among.size:
            raise MeshError(
                f"{name}: a whole ply is fixed at its centre and at one node on either "
                "side of it along x, but the mesh has no three such nodes: refine the "
                "mesh"
            )
        away = mesh.p[:, among] - target[:, None]
        return among[[np.hypot(*away).argmin()]]

    nodes, off = np.arange(mesh.p.shape[1]), _OFF * np.ptp(mesh.p)
    middle = nearest(np.zeros(2), nodes)
    others = nodes[nodes != middle]
    right = nearest(half, others[mesh.p[0, others] > off])
    left = nearest(-mesh.p[:, right[0]], others[mesh.p[0, others] < -off])
    held = {"middle_x": (middle, 0), "turn_left": (left, 1), "turn_right": (right, 1)}
    conditions = {}
    try:
        at = np.hstack([node for node, _ in held.values()])
        paths = geodesics(on_tool.surface, mesh.p[:, at], on_tool.touch)
        for i, (held_as, (node, axis)) in enumerate(held.items()):
            path = Geodesics(*(values[..., [i]] for values in paths))
            end = partial(_at_end, on_tool=on_tool, path=path, axis=axis)
            end(mesh.p[:, node], 1.0)
            conditions[held_as] = Condition(node, end, direction=np.eye(3)[axis])
    except OffSurfaceError as error:
        raise ValueError(
            f"{name}: the ply leaves the tool at {on_tool.place(error.position)}: use "
            "a smaller ply, or another contact point"
        ) from None
    return conditions


def _at_end(
    X: ndarray, t: float, on_tool: OnSurface, path: Geodesics, axis: int
) -> ndarray:
    """Displacement along an axis of a node at the end of a geodesic, shape (1,).

    On the growing tool; the node is at ``X``, (2, 1), in the flat ply.
    """
    x = path.on_growing(np.array([*on_tool.touch, 0.0]), t)
    return onto(on_tool.at("tool", t), x)[axis] - X[axis]


_NO_NET = (
    "the edges have no tension and the fibres no bending stiffness: compressed fibres "
    "buckle in the plane of the ply, and the state differs from the kinematic net"
)


def measured_on_tool(
    result: Result, axes: Axes, holding: Mapping[str, Condition]
) -> dict[str, float | str]:
    """Contact point, contact pressures, area fractions of defects, and advice.

    The contact point is in the axes of the tool; ``axes`` are the axes of the ply
    relative to the tool; ``holding`` are conditions on single nodes that prevent
    sliding.  Empty for a ply that is not on its tool.
    """
    ply, state = result.ply, result.states[-1]
    u, surface = state.u, result.tool(1.0)
    if surface is None or result.not_on_tool:
        return {}
    pressure = contact_pressure(ply, surface, u, 1.0, state.parameters)
    turn_deg = np.degrees(turn_of_normal(ply, surface, u))
    beyond = beyond_edges(ply, surface, u)
    figures: dict[str, float | str] = {
        **components_mm("touches_at", axes.origin),
        "max_contact_pressure_N_per_mm2": float(pressure.max()),
        "min_contact_pressure_N_per_mm2": float(pressure.min()),
        "bridging_share_of_area": share_of_area(ply, bridging(ply, u, pressure)),
        "max_turn_of_normal_deg": float(turn_deg.max()),
    }
    if beyond is not None:
        figures["beyond_tool_share_of_area"] = share_of_area(ply, beyond)
    if holding:
        figures["max_holding_force_N"] = _holding_force(result, surface, holding)
    return figures | _advice(result, surface, pressure, turn_deg, beyond)


def _advice(
    result: Result,
    surface: Surface,
    pressure: ndarray,
    turn: ndarray,
    beyond: ndarray | None,
) -> dict[str, str]:
    """Limitations of the results, and advice.

    From the pressure at nodes, and by element the rotation of the normal in degrees and
    the mask beyond the edges of the tool.
    """
    ply, state, u = result.ply, result.states[-1], result.u
    advice: dict[str, str] = {}
    if beyond is not None and beyond.any():
        advice["beyond_tool"] = (
            f"{100 * share_of_area(ply, beyond):.3g} % of the ply is beyond the edges "
            "of the tool or over its holes, where the surface of the tool is "
            "extrapolated: trim the ply there, or use a smaller ply or a larger tool"
        )
    off = off_triangles(ply, surface, u)
    if off is not None and off.any():
        advice["off_triangles"] = (
            f"under {100 * share_of_area(ply, off):.3g} % of the ply the smoothed tool "
            "deviates from its triangles by more than a tenth of their mean edge: use "
            "only one side of a shell, and triangles that are nearly equilateral"
        )
    if (coarse := turn > COARSE).any():
        advice["coarse_elements"] = (
            f"the normal of the tool rotates by up to {turn.max():.0f} degrees over "
            f"one element, and by more than {COARSE:.0f} degrees under "
            f"{100 * share_of_area(ply, coarse):.3g} % of the ply. The error of the "
            "shear angle may reach 3 degrees near edges and fillets of the tool: use "
            f"elements of {COARSE / turn.max():.0%} of the size there"
        )
    if surface.gradient(np.zeros((3, 1)))[2, 0] < 0:
        advice["faces_away"] = (
            "the tool faces down at the contact point of the ply, so that pressures "
            "have the opposite sign if the ply lies above it: in this case reverse the "
            "triangles of the tool"
        )
    elif (pressure < 0).all():
        advice["faces_away"] = (
            "the contact pressure is tensile everywhere: reverse the triangles of the "
            "tool if the ply lies on its other side"
        )
    load = ply.load(u, state.load_factor, state.parameters)
    if not (any(ply.fabric.bent) or load.any()):
        advice["not_the_net"] = _NO_NET
    return advice


def _holding_force(
    result: Result, surface: Surface, holding: Mapping[str, Condition]
) -> float:
    """Largest force along the tool of a node that prevents the ply from sliding."""
    state, ply = result.states[-1], result.ply
    forces = np.array([state.reactions[name] for name in holding]).T
    nodes = [at.nodes(name, ply.basis)[0] for name, at in holding.items()]
    x = ply.positions(state.u)[:, nodes]
    normal = surface.gradient(x) / np.linalg.norm(surface.gradient(x), axis=0)
    along = forces - (forces * normal).sum(axis=0) * normal
    return float(np.linalg.norm(along, axis=0).max())
