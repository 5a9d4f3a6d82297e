"""Tools and holders, which are terms of a ply that is formed.

`Tool` and `Holder` are declarations; `obstacle` and `holder` contain their terms.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem import CellBasis

from ..declarations import ELASTIC_SLIP, MOST_FRICTION
from ..fabric.law import number
from ..mesh.user_input import call_user_function, keep_copies, real_numbers, shortened
from ..ply.amount import Amount, AmountLike, Limits, Rows
from ..solve.on_surface import in_axes_of_ply
from ..surfaces.surface import Surface
from .holder import COMPARED, HolderPressure
from .motion import Motion, deepest, validated_at
from .obstacle import Obstacle, ToolContact, ToolTerm, no_reach
from .outline import ROUND_OFF

if TYPE_CHECKING:
    from .compaction import CompactionLaw, RigidHolder

#: Limits of the amounts of tools, by name.
LIMITS = {
    "motion": Limits(unit=" mm", components=3),
    "rotation": Limits(unit=" rad"),
    "friction": Limits(0.0, MOST_FRICTION),
    "gap": Limits(0.0, unit=" mm"),
    "pressure": Limits(0.0, unit=" N/mm2"),
    "force": Limits(0.0, unit=" N"),
}


class FormingContact(ToolContact):
    """Contact with the checks before a run and the figures of its result."""

    @staticmethod
    def check(ply: Any, moved: float) -> None:
        """See `check_tools`."""
        from .checks import check_tools

        check_tools(ply, moved)

    @staticmethod
    def figures(result: Any) -> dict[str, Any]:
        """See `formed`."""
        from .figures import formed

        return formed(result)


@dataclass(frozen=True, eq=False)
class Tool:
    """Rigid tool that a ply in space cannot penetrate; a term of a `Ply`.

    Parameters
    ----------
    surface
        The surface at the load factor 0, in the axes of the ply.  A surface with a
        method ``beyond_edges``, such as `drape.TriangleMesh`, ends at its edges.
    motion
        Final translation (3,) in mm, which grows in proportion to the load factor; or a
        function of the load factor that returns the translation, or a pair of a
        rotation matrix (3, 3) about the origin and a translation.  By default the tool
        does not move.
    side
        1 if the ply lies where φ is positive, −1 where it is negative.  By default the
        side of the undeformed ply.
    thickness
        Thickness of the ply in mm: its nodes keep half of it from the tool.
    outline
        Corners of a polygon in mm, shape (2, n), in the x-y plane of the surface: nodes
        that are outside at the start of a step do not touch the tool in it.  None for
        no outline.
    friction
        Coefficient μ of Coulomb friction with the ply, from 0 to 2; or a function of
        the load factor.
    elastic_slip
        Slip in mm up to which friction is elastic, before the ply slides.
    name
        Name of the term, of the force of the tool, and of its travel.
    stated
        Function that converts positions, shape (3, n), to the axes of messages, figures
        and sections.

    Examples
    --------
    A punch pushes the centre of a square ply 20 mm up; its edges are held:

    >>> from skfem import MeshQuad
    >>> from skfem_textile import Condition, Fabric, LoadStepper, Ply, Tool, drape
    >>> mesh = MeshQuad().refined(2).translated((-0.5, -0.5)).scaled(100.0)
    >>> punch = Tool(drape.Sphere(30.0, (0, 0, -30)), motion=(0, 0, 20), name="punch")
    >>> fabric = Fabric(10.0, shear=0.5, bending=(1.0, 1.0))
    >>> ply = Ply(mesh.with_defaults(), fabric, terms=[punch], dimension=3)
    >>> edges = {name: Condition(name) for name in ("left", "right", "top", "bottom")}
    >>> state = LoadStepper(ply, edges, steps=1).run().states[-1]
    >>> bool(state.reactions["punch"][2] > 0)
    True
    """

    surface: Surface
    motion: Motion | None = None
    side: int | None = None
    thickness: float = 0.0
    outline: ArrayLike | None = None
    friction: AmountLike = 0.0
    elastic_slip: float = ELASTIC_SLIP
    name: str = "tool"
    stated: Callable[[ndarray], ndarray] = in_axes_of_ply

    def __post_init__(self) -> None:
        keep_copies(self, "motion", "outline")

    def on(self, basis: CellBasis) -> "ToolContact":
        """Term on a basis of the displacement.

        Raises
        ------
        ValueError
            If the ply is in its plane, the surface is not valid or crosses the
            undeformed ply, or another argument is not valid.
        """
        obstacle = Obstacle.of(self, basis)
        term = FormingContact(self.name, obstacle, basis)
        return _with_friction(obstacle.what, self, term)


@dataclass(frozen=True, eq=False)
class Holder:
    """Blank holder, which keeps a ply near a surface or presses it there.

    Several holders with different outlines are the segments of one.

    Parameters
    ----------
    surface
        Surface towards which the holder presses, usually the flange of a die.
    gap
        Distance in mm between holder and surface; or a function of the load factor.
    pressure
        Pressure in N/mm² of undeformed area towards the surface, uniform over the part
        of the ply within the outline; or a function of the load factor.  A gap, a
        pressure or a force is given.
    force
        Force in N of a rigid holder towards the surface, on the computed part of the
        ply within the outline; or a function of the load factor.  The pressure follows
        from the thickness of the ply under the holder.
    compaction
        Law of compaction of the ply under a force, such as `Compaction`.
    motion, side, thickness, outline, friction, elastic_slip, name, stated
        See `Tool`.

    Examples
    --------
    A holder that presses with 0.01 N/mm² on the flange of a die above the ply, outside
    a circle:

    >>> import numpy as np
    >>> from skfem_textile import Holder, drape
    >>> t = np.linspace(0, 2 * np.pi, 41)
    >>> ring = np.hstack([r * np.array([np.cos(t), np.sin(t)]) for r in (200, 90)])
    >>> die = drape.Plane((0, 0, 0.15))
    >>> holder = Holder(die, pressure=0.01, side=-1, outline=ring, name="holder")
    """

    surface: Surface
    gap: AmountLike | None = None
    pressure: AmountLike | None = None
    force: AmountLike | None = None
    compaction: "CompactionLaw | None" = None
    motion: Motion | None = None
    side: int | None = None
    thickness: float = 0.0
    outline: ArrayLike | None = None
    friction: AmountLike = 0.0
    elastic_slip: float = ELASTIC_SLIP
    name: str = "holder"
    stated: Callable[[ndarray], ndarray] = in_axes_of_ply

    def __post_init__(self) -> None:
        keep_copies(self, "motion", "outline")

    def on(self, basis: CellBasis) -> "ToolContact | HolderPressure":
        """Term on a basis of the displacement.

        Raises
        ------
        ValueError
            See `Tool.on`; also if not exactly one of gap, pressure and force is given,
            or it is negative, a force has no law of compaction, or no part of the ply
            is within the outline.
        """
        what = f"holder {self.name!r}"
        given = self.gap, self.pressure, self.force
        if sum(one is not None for one in given) != 1:
            raise ValueError(f"{what}: specify either a gap, a pressure or a force")
        if self.compaction is None and self.force is not None:
            raise ValueError(
                f"{what}: a force requires a law of compaction of the ply: set "
                "compaction, or, for a tool that moves, omit the force"
            )
        if self.compaction is not None and self.force is None:
            raise ValueError(
                f"{what}: a law of compaction requires a force: set force, or omit "
                "compaction"
            )
        term: ToolContact | HolderPressure
        if self.gap is None:
            obstacle = Obstacle.of(self, basis, no_reach)
            pressure = self._pressure(what)
            term = HolderPressure(self.name, pressure, obstacle, basis)
            if term.rigid:
                most = max(validated_at(term.rigid.force), key=term.rigid.force)
                term.reaches(basis.zeros(), most)  # with a law that carries the force
        else:
            reach = amount_of(self, "gap", what)
            term = FormingContact(self.name, Obstacle.of(self, basis, reach), basis)
        if not any(term.reaches(basis.zeros(), t) for t in (0.0, 1.0)):
            raise ValueError(
                f"{what}: no part of the undeformed ply is within its edges or "
                "outline: check the positions and units of holder and ply"
            )
        return _with_friction(what, self, term)

    def _pressure(self, what: str) -> "Callable[[float], float] | RigidHolder":
        """Pressure as a function of the load factor, or the holder with a force."""
        if self.force is None:
            return amount_of(self, "pressure", what)
        from .compaction import CompactionLaw, RigidHolder

        if not isinstance(self.compaction, CompactionLaw):
            raise ValueError(
                f"{what}: compaction must be a law of compaction, such as "
                f"Compaction(0.3, 1e-3, 8.0), got {shortened(self.compaction)}"
            )
        _check_compaction(f"{what}: law of compaction", self.compaction)
        return RigidHolder(what, amount_of(self, "force", what), self.compaction)


def _check_compaction(what: str, law: "CompactionLaw") -> None:
    """Refuse a law without a finite pressure that falls to zero at ``free``."""
    thickness = number(f"{what}: free", law.free, above=0) * COMPARED
    found = call_user_function(what, law.pressure_at, thickness)
    p = real_numbers(what, found)
    if p.shape != thickness.shape or not np.isfinite(p).all():
        raise ValueError(
            f"{what}: the pressure must be finite, a number for each thickness, got "
            f"{shortened(found)}"
        )
    if (np.diff(p) > 0).any() or abs(p[-1]) > ROUND_OFF * p[0]:
        raise ValueError(
            f"{what}: the pressure must fall with the thickness, to 0 at {law.free:g} "
            f"mm, got {p[0]:.4g} to {p[-1]:.4g} N/mm2"
        )


_Term = TypeVar("_Term", bound=ToolTerm)


@dataclass(frozen=True)
class AboutAxis:
    """Motion of a tool: rotation about an axis through a point, then a translation.

    Parameters
    ----------
    translation
        Translation in mm.
    rotation
        Angle in radians, counterclockwise if the axis points to the viewer.
    axis
        Direction of the axis, of any length.
    point
        Point on it in mm, shape (3,).
    """

    translation: Rows
    rotation: Rows
    axis: Sequence[float]
    point: ndarray

    def __call__(self, t: float) -> tuple[ndarray, ndarray]:
        """Rotation matrix about the origin, and translation, at a load factor."""
        turn = rotation_matrix(self.axis, self.rotation(t))
        return turn, self.point - turn @ self.point + self.translation(t)

    @property
    def load_factors(self) -> list[float]:
        """See `Rows.load_factors`."""
        return sorted({*self.translation.load_factors, *self.rotation.load_factors})

    def check_steps(self, load_factors: Sequence[float]) -> None:
        """See `Rows.check_steps`."""
        self.translation.check_steps(load_factors)
        self.rotation.check_steps(load_factors)


def rotation_matrix(axis: Sequence[float], angle: float) -> ndarray:
    """Matrix of a rotation in radians about an axis of any length, shape (3, 3)."""
    from scipy.spatial.transform import Rotation

    unit = np.array(axis) / np.abs(axis).max()
    unit /= np.linalg.norm(unit)
    return np.asarray(Rotation.from_rotvec(angle * unit).as_matrix())


def deepest_of(tools: Sequence[Tool | Holder], nodes: ndarray) -> str:
    """Name of the tool that reaches deepest, see `deepest`.

    Not of a holder with a pressure or force, whose force is not a reaction.

    Parameters
    ----------
    tools
        The tools.
    nodes
        Nodes of the flat ply in mm, shape (2, n_nodes).

    Raises
    ------
    ValueError
        If there is no other tool.
    """
    known = [x for x in tools if isinstance(x, Tool) or x.gap is not None]
    if not known:
        raise ValueError(
            f"tool {tools[0].name!r} is a holder with a pressure or force, but there "
            "is no tool against which it presses: add one, or state its gap"
        )
    obstacles = []
    for tool in known:
        gap = tool.gap if isinstance(tool, Holder) else None
        reach = None if gap is None else amount_of(tool, "gap", f"tool {tool.name!r}")
        obstacles.append(Obstacle.near(tool, nodes, reach))
    return known[deepest(obstacles)[0]].name


def amount_of(tool: Any, name: str, what: str) -> Amount:
    """Amount of a tool or holder, validated at load factors before a run.

    Parameters
    ----------
    tool
        The tool.
    name
        Name of the amount, one of `LIMITS`.
    what
        The tool in messages.
    """
    limits = LIMITS[name]
    if name == "gap":
        limits = limits._replace(least=tool.thickness)
    amount = Amount(f"{what}: {name}", getattr(tool, name), limits)
    for t in validated_at(amount):
        amount(t)
    return amount


def _with_friction(what: str, tool: Tool | Holder, term: _Term) -> _Term:
    """The term of a tool, with its friction if there is any."""
    coefficient = amount_of(tool, "friction", what)
    slip = number(f"{what}: friction: elastic_slip", tool.elastic_slip, above=0)
    if callable(tool.friction) or tool.friction:
        term.with_friction(coefficient, slip)
    stated = ((name, getattr(tool, name, None)) for name in LIMITS)
    term.amounts = tuple(Amount(f"{what}: {k}", x) for k, x in stated if x is not None)
    return term
