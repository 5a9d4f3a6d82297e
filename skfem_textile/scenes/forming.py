"""Scenes of plies that a punch forms through a die, above the plane of a holder.

The ply lies in the plane z = 0, in the middle of the gap between die and holder, and
the punch touches the plane of the holder from below.  A holder with a pressure has no
plane: it presses the ply on the flat flange of the die.  Free edges have a constant
tension along the fibres: fibres at right angles transmit the same tension across an
edge of any direction.

A quarter suffices if tools and fibres have planes of symmetry.  Otherwise the whole
ply is fixed in its plane at its centre, and without edge tension, which keeps it from
turning, along y at a second node.  These nodes have no reactions if tools and ply are
symmetric under half a turn about z.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, TypeAlias, Unpack

import numpy as np
from numpy import ndarray
from skfem import CellBasis, FacetBasis, LinearForm, Mesh, asm

from ..contact import Holder, Tool, contacts
from ..contact.obstacle import refuse_extent
from ..declarations import scenes as declared
from ..declarations.scenes import FormedOptions
from ..mesh.checks import MeshError
from ..mesh.user_input import real_numbers, shortened
from ..ply.terms import VectorTerm
from ..solve.conditions import Condition
from ..solve.quantities import Quantity
from ..solve.result import Result
from ..surfaces.analytic import Die, Height, HeightField, Plane, Punch, positive_length
from ..surfaces.analytic import double_dome as dome
from ..surfaces.surface import SAME_AXES, Axes, Surface
from .rectangle import flat_ply, free_edges, half_way, in_planes
from .scene import Scene, with_parameters

if TYPE_CHECKING:
    from ..surfaces.triangle_mesh import TriangleMesh
    from .plies import Plies

#: Default distance between die and holder in mm.
GAP = declared.HOLDER_GAP

# Distance from the lowest point of a die, relative to its size, within which its flange
# is flat.  Chosen: 0.03 mm of a die of 300 mm, above the rounding of files.
_FLAT = 1e-4

# Height of a double dome in mm within which the flange of its die is flat, a third of
# the default gap; size of a holder relative to its inner edge, beyond any ply; and
# corners of the latter.  Chosen.
_FLAT_DOME, _FAR, _CORNERS = 0.1, 100.0, 180

# Ratio of the extents of punch and die above which their units differ.  Chosen: below
# the length of an inch, 25.4 mm.
_OTHER_UNIT = 20.0

# Share of the largest force of a tool in a run above which holding forces are reported.
_HOLDING = 0.01

_NO_EXACT = "no exact solution is known"

# Scenes whose holder presses.
_Pressed: TypeAlias = (
    declared.HemisphereForming | declared.DoubleDomeForming | declared.Forming
)


@dataclass(frozen=True, eq=False)
class ConstantTension:
    """Constant tension along the fibres on the free edges of a flat ply.

    Parameters
    ----------
    tension
        Tension in N/mm of fibres at right angles.
    held
        Names of boundaries without tension.
    """

    tension: float
    held: tuple[str, ...]

    def on(self, basis: CellBasis) -> VectorTerm:
        """Term on a basis of the displacement."""
        facets = free_edges(basis.mesh, self.held)
        edges = FacetBasis(
            *(basis.mesh, basis.elem, basis.mapping), facets=facets, dofs=basis.dofs
        )

        @LinearForm
        def work(v, w):
            return self.tension * (w.n[0] * v[0] + w.n[1] * v[1])

        return VectorTerm("edge tension", asm(work, edges), 1.0)


def formed_ply(
    name: str,
    tools: Sequence[Tool | Holder],
    mesh: str | Mesh,
    axes: Axes = SAME_AXES,
    **ply: Unpack[FormedOptions],
) -> Scene:
    """Scene of a ply between tools.

    Parameters
    ----------
    name
        Name of the scene.
    tools
        The tools, first the one whose force is reported.  For a quarter they must be
        symmetric about the planes x = 0 and y = 0.
    mesh, **ply
        See `flat_ply`, with other defaults: a size of 12 × 12, sides of 300 mm, and an
        edge tension of 0.2 N/mm.
    axes
        Axes of the scene in the axes of the user's tools.
    layup
        Plies that are formed together, see `Case.ply`: a text such as ``[0/90, ±45]s``,
        or the angle of each ply in degrees, from the bottom to the top.  One ply by
        default.
    ply_friction, ply_thickness
        Friction between the plies, and their thickness in mm, see `contact.Stack`.

    Raises
    ------
    ValueError
        If the mesh is not valid or does not fit, a number is not valid, or the lay-up
        cannot be read.
    """
    given = declared.Formed(**ply)
    plies = _plies(name, given)
    turned_deg = plies.angles_deg if plies else ()
    at_rest = flat_ply(name, mesh, turned_deg, **given.ply())
    flat, _, tension, held = at_rest
    held_at = in_planes(name, flat) if held else _at_centre(name, flat, not tension)
    warp, weft = at_rest.fibres
    return Scene(
        name=name,
        mesh=flat,
        warp=warp,
        weft=weft,
        conditions=held_at,
        driven=tools[0].name if tools else "",
        dimension=3,
        fibre_ends=dict.fromkeys(held, "mirror"),
        loads=(ConstantTension(tension, held),) if tension else (),
        tools=tuple(replace(tool, stated=axes.of_tool) for tool in tools),
        first=(Quantity("Note", "held"),),
        measured=partial(_measured, holding=() if held else tuple(held_at)),
        misfit=_NO_EXACT,
        axes=axes,
        plies=plies,
    )


def _press_tools(
    name: str,
    punch: Surface,
    die: Surface,
    given: _Pressed,
    outline: ndarray,
    sides: tuple[int | None, int | None] | None = None,
) -> list[Tool | Holder]:
    """Tools of a ply in the middle of the gap between holder and die.

    A holder with a pressure or force presses the ply within an outline on the plane of
    the flange.  Of tools from files ``sides`` are the sides of punch and die on which
    the ply lies; the holder presses along the normals of the die, so that it does not
    push the ply over a rounded edge.
    """
    gap, travel = _gap_at_rest(name, given), given.travel
    of_punch, of_die = sides or (None, None)
    if not (np.isfinite(travel) and travel):
        raise ValueError(
            f"{name}: the travel of the punch must be a length in mm other than 0, "
            f"got {travel:g}"
        )
    up = float(np.sign(travel))
    flange = Plane((0.0, 0.0, 0.5 * up * gap), (0.0, 0.0, up))
    holder = Holder(flange, gap, compaction=given.compaction, side=-1, name="holder")
    if not (given.pressure is given.force is None):
        holder = replace(
            holder,
            surface=die if sides else flange,
            side=of_die if sides else -1,
            outline=outline,
            gap=None,
            pressure=given.pressure,
            force=given.force,
        )
    tools = (
        Tool(punch, motion=(0.0, 0.0, travel), side=of_punch, name="punch"),
        Tool(die, side=of_die, name="die"),
        holder,
    )
    return [replace(tool, friction=given.friction) for tool in tools]


def _gap_at_rest(name: str, given: declared.Formed) -> float:
    """Distance between die and holder before a pressure or force acts."""
    stated = [x for x in ("gap", "pressure", "force") if getattr(given, x) is not None]
    if len(stated) > 1:
        raise ValueError(
            f"{name}: a holder has either a gap, a pressure or a force: omit "
            f"{' or '.join(stated)}"
        )
    if given.gap is None:
        plies = _plies(name, given)
        return GAP + (sum(plies.thickness) if plies else 0.0)
    return _gap(name, given.gap)


def _plies(name: str, given: declared.Formed) -> "Plies | None":
    """Plies of the lay-up of a scene; None without."""
    if given.layup is not None:
        from .plies import plies_of  # needed for few scenes

        return plies_of(name, given.layup, given)
    for key in "ply_friction", "ply_thickness":
        if np.any(getattr(given, key)):
            raise ValueError(
                f"{name}: {key} requires layup, because there is one ply: set it too"
            )
    return None


def _beyond(
    a: float, b: float, exponent: int, given: declared.FormedBySymmetricTools
) -> ndarray:
    """Outline of a holder beyond (x/a)ⁿ + (y/b)ⁿ = 1 around the axis, shape (2, m)."""
    angle = np.linspace(0, 2 * np.pi, _CORNERS, endpoint=False)
    c, s = np.cos(angle), np.sin(angle)
    curve = np.sign([c, s]) * np.abs([c, s]) ** (2 / exponent) * [[a], [b]]
    curve = np.hstack([curve, curve[:, :1]])
    ring = np.hstack([_FAR * curve, curve])
    return ring - np.array(given.centre)[:, None]


def _at_centre(name: str, mesh: Mesh, turns: bool) -> dict[str, Condition]:
    """Conditions of a whole ply against motions in its plane."""
    half = half_way(name, mesh)
    centre = int(np.hypot(*mesh.p).argmin())
    held = {"centre": _held(mesh, centre, (0.0, 0.0, None))}
    if turns:
        away = np.hypot(*(mesh.p - half[:, None]))
        away[centre] = np.inf
        held["turn"] = _held(mesh, int(away.argmin()), (None, 0.0, None))
    return held


def _held(mesh: Mesh, node: int, value: tuple[float | None, ...]) -> Condition:
    """Condition on a node, in every ply of a stack."""
    return Condition(partial(_is_at, point=mesh.p[:, node]), value)


def _is_at(X: ndarray, point: ndarray) -> ndarray:
    return (point[:, None] == X).all(axis=0)


def _measured(result: Result, holding: Collection[str]) -> dict[str, float | str]:
    """Largest force of a node that holds a formed ply."""
    figures: dict[str, float | str] = {}
    last = result.states[-1].reactions
    forces = [last[name] for name in holding]
    if forces:
        largest = float(np.linalg.norm(forces, axis=1).max())
        figures["max_holding_force_N"] = largest
        names = [tool.name for tool in contacts(result.ply)]
        on_tools = [[state.reactions[x] for x in names] for state in result.states]
        pushing = float(np.linalg.norm(on_tools, axis=-1).max(initial=0.0))
        if largest > _HOLDING * pushing > 0:
            figures["held"] = (
                f"the node at the centre of the ply is held with {largest:.3g} N, "
                f"{largest / pushing:.0%} of the largest force of a tool in the run: "
                "without it the ply would slide. Put the centre of the ply on the axis "
                "of the tools, or hold edges of the ply"
            )
    return figures


@with_parameters(declared.HemisphereForming)
def hemisphere_forming(given: declared.HemisphereForming) -> Scene:
    """Ply that a punch with a hemispherical end forms through a round hole.

    Parameters
    ----------
    mesh, size, jitter, seed, fibres, width, height, tension, part
        See `formed_ply`.
    layup, ply_friction, ply_thickness
        See `formed_ply`.
    centre
        Centre of the ply, x and y in mm from the axis of the tools; the whole ply is
        computed if it is not 0.
    radius
        Radius of the punch in mm.
    fillet
        Radius of the fillet of the die in mm.
    travel
        Final travel of the punch in mm.
    gap, pressure, force, compaction
        See `forming`; the holder presses on the flange beyond the fillet.
    clearance
        Radius of the hole less the radius of the punch in mm.

    Raises
    ------
    ValueError
        See `formed_ply`.

    Examples
    --------
    >>> from skfem_textile import Fabric
    >>> from skfem_textile.scenes import Case, hemisphere_forming
    >>> scene = hemisphere_forming("aligned", travel=5.0, size=(4, 4))
    >>> fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
    >>> summary = Case(scene=scene, fabric=fabric, steps=1).run().summary()
    >>> summary["converged"]
    True
    """
    name = "hemisphere_forming"
    radius = positive_length(f"{name}: radius", given.radius)
    middle, (x, y) = 0.5 * _gap_at_rest(name, given), _centre(name, given.centre)
    punch = Punch(radius, (-x, -y, -radius - middle))
    hole = radius + positive_length(f"{name}: clearance", given.clearance)
    die = Die(hole, given.fillet, (-x, -y, middle))
    positive_length(f"{name}: travel", given.travel)
    edge = hole + die.fillet
    outline = _beyond(edge, edge, 2, given)
    tools = _press_tools(name, punch, die, given, outline)
    return _whole_if_moved(name, tools, given.mesh, given)


@with_parameters(declared.DoubleDomeForming)
def double_dome_forming(given: declared.DoubleDomeForming) -> Scene:
    """Ply that a double dome forms in a die of the same shape.

    The punch is `skfem_textile.drape.double_dome`, its long side along x.  The cavity
    of the die has the same height, 60 mm.

    Parameters
    ----------
    mesh, size, jitter, seed, fibres, width, height, tension, part
        See `formed_ply`; the size is 24 × 16 and the width 470 mm by default.
    layup, ply_friction, ply_thickness
        See `formed_ply`.
    travel
        Final travel of the punch in mm, at most the height of the dome.
    gap, pressure, force, compaction
        See `forming`; the holder presses where the flange is flat within 0.1 mm.
    clearance
        Length by which the cavity is longer and wider than the punch on each side, in
        mm.

    Raises
    ------
    ValueError
        See `formed_ply`.
    """
    name = "double_dome_forming"
    height, length, width = 60.0, 180.0, 75.0
    middle = 0.5 * _gap_at_rest(name, given)
    if (travel := positive_length(f"{name}: travel", given.travel)) > height:
        raise ValueError(
            f"{name}: the travel must be at most the height of the dome, {height:g} "
            f"mm, got {travel:g} mm"
        )
    x, y = _centre(name, given.centre)
    punch = _moved(dome(height, length, width), (x, y, middle))
    clearance = positive_length(f"{name}: clearance", given.clearance)
    length, width = length + clearance, width + clearance
    die = _moved(dome(height, length, width), (x, y, -height - middle))
    flat = np.log(height / _FLAT_DOME) ** 0.25
    outline = _beyond(flat * length, flat * width, 4, given)
    tools = _press_tools(name, punch, die, given, outline)
    return _whole_if_moved(name, tools, given.mesh, given)


def _whole_if_moved(
    name: str,
    tools: Sequence[Tool | Holder],
    mesh: str | Mesh,
    given: declared.FormedBySymmetricTools,
) -> Scene:
    """Scene of a ply, which is whole if its centre is beside the axis of the tools."""
    axes, ply = Axes(np.append(_centre(name, given.centre), 0.0)), given.formed()
    if any(given.centre):
        if given.part == "quarter":
            raise ValueError(
                f"{name}: a quarter of the ply has its centre on the axis of the "
                "tools: use the whole ply, or the centre (0, 0)"
            )
        ply["part"] = "whole"
    return formed_ply(name, tools, mesh, axes, **ply)


def _centre(name: str, centre: tuple[float, float]) -> ndarray:
    point = real_numbers(f"{name}: centre", centre)
    if point.shape != (2,) or not np.isfinite(point).all():
        raise ValueError(
            f"{name}: the centre must be two finite numbers, got {shortened(centre)}"
        )
    return point


def _moved(surface: HeightField, origin: tuple[float, float, float]) -> HeightField:
    """The same surface in axes with this origin."""
    return HeightField(partial(_height, surface=surface, origin=origin))


def _height(
    x: ndarray, y: ndarray, surface: HeightField, origin: tuple[float, float, float]
) -> Height:
    height = surface.height(x + origin[0], y + origin[1])
    return height._replace(h=height.h - origin[2])


@with_parameters(declared.Forming)
def forming(given: declared.Forming) -> Scene:
    """Ply that a punch from a file forms through a die from a file.

    Punch and die are in their initial positions, in the same axes.  The ply lies
    between the holder and the lowest point of the die, or its highest one if the punch
    moves down.  The punch begins at or before the plane of the ply.

    Parameters
    ----------
    punch, die
        Triangulated tools, see `skfem_textile.io.read_surface`.
    mesh, size, jitter, seed, fibres, width, height, tension, part
        See `formed_ply`; the part is the whole ply by default.
    layup, ply_friction, ply_thickness
        See `formed_ply`.
    travel
        Final travel of the punch along z in mm, negative if it moves down.
    gap
        Distance between die and holder in mm: by default `GAP` and the thickness of
        all plies of a lay-up.
    pressure
        Pressure of the holder in N/mm² instead of a gap.  It acts on the part of the
        ply under the flange of the die, the triangles at its lowest point.
    force, compaction
        Force in N there of a rigid holder instead of a gap, and the law of compaction
        of the ply under it, see `Holder`.
    centre
        Centre of the ply, x and y in the axes of the tools in mm.

    Raises
    ------
    ValueError
        See `formed_ply`; also if two of gap, pressure and force are given, if a tool is
        smaller than two elements of the ply, if the punch begins beyond the plane of
        the ply or passes it completely, or if a holder with a pressure or force has no
        flange to press on.
    """
    punch, die, travel = given.punch, given.die, given.travel
    gap = _gap_at_rest("forming", given)
    _refuse_units(punch, die)
    middle, up = 0.5 * gap, float(np.sign(travel))
    flange = float((up * die.facets.points[2]).min())
    centre = _centre("forming", given.centre)
    axes = Axes(np.append(centre, up * (flange - middle)))
    punch, die = punch.moved(*axes), die.moved(*axes)
    presses = not (given.pressure is given.force is None)
    outline = _flange(die, up, flange) if presses else np.empty((2, 0))
    sides = _side(punch, up), _side(die, -up)
    tools = _press_tools("forming", punch, die, given, outline, sides)
    scene = formed_ply("forming", tools, given.mesh, axes, **given.formed())
    for name, tool in ("punch", punch), ("die", die):
        refuse_extent(f"forming: the {name}", tool, scene.mesh)
    heights, plane = up * punch.facets.points[2], f"{axes.origin[2]:.6g} mm"
    if (highest := float(heights.max())) > 0:
        raise ValueError(
            f"forming: the punch begins {highest:.4g} mm beyond the plane of the ply, "
            f"z = {plane}: move it back along z, or reverse the sign of the travel"
        )
    if (lowest := float(heights.min()) + abs(travel)) > 0:
        raise ValueError(
            f"forming: the whole punch passes the plane of the ply, z = {plane}, by "
            f"{lowest:.4g} mm: extend its walls, or reduce the travel"
        )
    return scene


def _refuse_units(punch: "TriangleMesh", die: "TriangleMesh") -> None:
    """Refuse a punch and a die in two units of length."""
    one, other = (float(np.ptp(x.facets.points, axis=1).max()) for x in (punch, die))
    if max(one, other) > _OTHER_UNIT * min(one, other):
        raise ValueError(
            f"forming: the punch extends over {one:.3g} mm and the die over "
            f"{other:.3g} mm: their files must have the same unit, or each [[tools]] "
            "its own"
        )


def _flange(die: "TriangleMesh", up: float, flange: float) -> ndarray:
    """Outline of the flat triangles of a die at its lowest point, shape (2, n).

    ``flange`` is this point in the axes of the user, times the sign ``up``.
    """
    from ..surfaces.tool_mesh import ToolMesh

    points, (triangles,) = die.facets.points, die.facets.cells
    height = up * points[2]
    flat = (height - height.min() <= _FLAT * np.ptp(points)).take(triangles).all(axis=0)
    try:
        curves = ToolMesh(points, (triangles[:, flat],)).boundary()
    except MeshError:
        raise ValueError(
            f"forming: the die has no flat flange at z = {up * flange:.6g} mm on which "
            "a holder could press the ply: specify its gap, or describe the holder "
            "with its outline in [[tools]]"
        ) from None
    begin = curves[0][:2, :1]
    return np.hstack([x for curve in curves for x in (curve[:2], curve[:2, :1], begin)])


def _side(tool: "TriangleMesh", upwards: float) -> int | None:
    """Side of a tool that faces up, 1, or down, −1, at its last point that way.

    None if the triangles there are vertical.
    """
    facets = tool.facets
    points, (triangles,) = facets.points, facets.cells
    height = upwards * points[2]
    last = (height.max() - height <= _FLAT * np.ptp(points)).take(triangles).any(axis=0)
    facing = upwards * float(facets.normals()[2, last] @ facets.areas()[last])
    return int(np.sign(facing)) or None


def _gap(name: str, gap: float) -> float:
    number = real_numbers(f"{name}: holder gap", gap)
    if number.shape or not 0 <= number < np.inf:
        raise ValueError(
            f"{name}: the holder gap must be a length of at least 0 mm, got {gap!r}"
        )
    return float(number)
