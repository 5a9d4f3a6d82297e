"""Ways to equilibrium at a given load, by name."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy import ndarray

from .body import Parameters
from .problem import Problem, Start, Tangent
from .states import Equilibrium, NoEquilibriumError

# Shares of the compression to keep in the geometric stiffness, tried in this order.
_COMPRESSION_SHARES = (1.0, 0.5, 0.0)

# Fibre tension in N/mm in the first geometric stiffness of a ply whose tangent is
# singular.  Chosen: along the fibres it must not outweigh the stiffness of a crimped
# fabric at rest.  Where the iteration ends does not depend on it.
_FIRST_TENSION = 0.1

# The same where nodes are on surfaces over the shear stiffness, at least.  Chosen: a
# start there is far from inextensible; without loads a sphere takes fewest solves.
_OVER_SHEAR_STIFFNESS = 10.0

# Share of the largest force that is unbalanced near an equilibrium.  Chosen: from there
# on the mean stretches are known well enough for a stiffness.
_NEAR = 0.1

# Over the tolerance what is unbalanced at the end of an iteration that met rounding.
# Chosen: an iteration that converges passes such residuals in one or two increments.
_STALLED = 100.0

#: What to do where rounding keeps forces from balancing.
LESS_ROUNDING = (
    "coordinates of mesh and surfaces that are nearer to the origin, for what is left "
    "is rounding"
)

# What to do where a ply on a surface finds no balance.
_ON_SURFACE = (
    "a ply that ends before sharp corners of the surface; where it has none, tension "
    "on the edges or fibres that resist bending"
)

# Halvings of an increment in a line search, and until every law has a value: shorter
# ones than that lead nowhere in the iterations that are allowed.
_LINE_SEARCH_HALVINGS, _HALVINGS_WITHIN_LAWS = 20, 12

# Share of the slope by which the energy must fall in a line search (Armijo 1966; the
# value is the usual one), and round-off as a share of the energy.
_ARMIJO, _ROUND_OFF = 1e-4, 1e-12


class Iterate(NamedTuple):
    """A tangent, the displacement to which it led, forces and parameters there."""

    tangent: Tangent
    u: ndarray
    f: ndarray
    parameters: Parameters


class Strategy(Protocol):
    """A way to equilibrium, in ``most`` iterations at most.

    Its ``repr`` tells it from others where a checkpoint is resumed.  If the tangents
    that it marks as altered tell whether it stays on the path of the load, it says so
    by ``follows_path = True``; else no path is resolved.
    """

    @property
    def most(self) -> int:
        """Iterations at most."""
        ...

    def iterates(
        self, problem: Problem, start: Start, fixed_values: ndarray
    ) -> Iterator[Iterate]:
        """Endless iterates; those after the first keep the fixed unknowns."""
        ...


@dataclass(frozen=True)
class Mixed:
    """Mixed-integration-point Newton, its tangent kept positive definite if it can be.

    The geometric stiffness takes the fibre tensions that the previous iteration
    predicted, T(ε) + T′ ∂ε·∇du, not those of its displacement, which are far larger
    wherever nearly inextensible fibres turn (Magisano, Leonetti & Garcea 2017).  The
    residual is unchanged.  Near the equilibrium the stiffnesses of the discretisation
    become once what they are there.  Where the tangent is indefinite, compression is
    halved or dropped in it, so that the increments do not run to saddle points, and no
    increment changes the displacement gradient by more than ``longest``, but for the
    first of a ply in its plane.  In space shear moments alone make the tangent
    indefinite across the ply: as a last resort what resists shear is made positive
    semi-definite.
    """

    most: int = 30
    longest: float = 1.0
    follows_path: ClassVar[bool] = True

    def iterates(
        self, problem: Problem, start: Start, fixed_values: ndarray
    ) -> Iterator[Iterate]:
        """Endless iterates."""
        u, near = start.u, False
        tangent, p = _first_tangent(problem, start)
        f = problem.forces_of(start, p)
        du = tangent.increment(f, u, fixed_values)
        if problem.in_space:
            du = self._shortened(problem, du)
        while True:
            du = within_laws(problem, u, du, p)
            tension = problem.ply.geometric_tension(u, du, p)
            contact = tangent.contact(f, du)
            u = problem.moved(u, du)
            f = problem.residual(u, p)
            if not near and problem.unbalanced(f, u) <= _NEAR * np.abs(f).max():
                near = True
                if problem.surfaces:
                    # Its forces are so large that this is early: tensions at u are not
                    # yet what they will be, but predicted ones are.
                    after = problem.updated(p, u, tension)
                else:
                    after = problem.settled(p, u)
                f = f if after is p else problem.residual(u, after)
                p = after
            yield Iterate(tangent, u, f, p)
            tangent = definite(problem, u, p, tension, contact)
            du = self._shortened(problem, tangent.increment(f, u, fixed_values))

    def _shortened(self, problem: Problem, du: ndarray) -> ndarray:
        return du / max(1.0, _largest_gradient(problem, du) / self.longest)


@dataclass(frozen=True)
class Descent:
    """Newton with a positive definite tangent and a line search on the energy.

    Every increment but the first, which brings the fixed unknowns to their values,
    lowers the energy and does not fold the ply.  The first also moves the ply a little
    along its softest motion, ``imperfection`` times the size of an element, so that
    symmetry does not hold it on a saddle point.  Slower than `Mixed`, as the energy of
    stiff fibres allows short increments only.
    """

    most: int = 100
    imperfection: float = 0.01

    def iterates(
        self, problem: Problem, start: Start, fixed_values: ndarray
    ) -> Iterator[Iterate]:
        """Endless iterates, until the energy falls no more."""
        u, (tangent, p) = start.u, _first_tangent(problem, start)
        du = tangent.increment(problem.forces_of(start, p), u, fixed_values)
        du = du + self.imperfection * problem.element_size * tangent.softest()
        u = problem.moved(u, within_laws(problem, u, du, p))
        while True:
            f = problem.residual(u, p)
            yield Iterate(tangent, u, f, p)
            tension = problem.ply.geometric_tension(u, np.zeros_like(u), p)
            tangent = definite(problem, u, p, tension)
            du = tangent.increment(f, u, fixed_values)
            u = problem.moved(u, _shortened(problem, u, du, f, p))


@dataclass(frozen=True)
class Newton:
    """Newton's method as it stands: for small steps, and for comparison."""

    most: int = 20

    def iterates(
        self, problem: Problem, start: Start, fixed_values: ndarray
    ) -> Iterator[Iterate]:
        """Endless iterates."""
        u, p = start.u, start.parameters
        f, tangent = problem.forces_of(start, p), start.tangent
        if tangent is None or problem.surfaces:  # which move with the load factor
            tangent = Tangent(problem, u, p)
        while True:
            du = within_laws(problem, u, tangent.increment(f, u, fixed_values), p)
            u = problem.moved(u, du)
            f = problem.residual(u, p)
            yield Iterate(tangent, u, f, p)
            tangent = Tangent(problem, u, p)


STRATEGIES: dict[str, Strategy] = {
    "mixed": Mixed(),
    "descent": Descent(),
    "newton": Newton(),
}


def balanced(
    problem: Problem,
    iterates: Iterator[Iterate],
    fixed_values: ndarray,
    most: int,
    most_altered: float = np.inf,
    report: Callable[[int, float, float], None] = lambda *_: None,
) -> Equilibrium:
    """Take iterates until the forces balance and the fixed unknowns have their values.

    Parameters
    ----------
    problem, iterates, fixed_values
        What to solve, the iterates of a strategy, and the values of the fixed unknowns.
    most, most_altered
        How many iterates to take, and how many altered tangents.
    report
        Told the number of each iteration, its residual and its tolerance.

    Raises
    ------
    NoEquilibriumError
        If the iteration gives up, or the forces never balance.
    """
    residuals: list[float] = []
    altered = 0
    on_surface = _ON_SURFACE if problem.surfaces else ""
    for tangent, u, f, parameters in islice(iterates, most):
        residuals.append(problem.unbalanced(f, u))
        tolerance = tangent.tolerance(u, f)
        report(len(residuals), residuals[-1], tolerance)
        altered += tangent.altered
        if altered > most_altered:
            raise NoEquilibriumError(
                f"more than {most_altered:g} tangents were indefinite on the way",
                problem.around(problem.unfixed(f, u)),
                advice=on_surface,
            )
        if residuals[-1] <= tolerance and problem.is_fixed(u, fixed_values):
            return Equilibrium(u, f, parameters, tuple(residuals), tolerance, altered)
    stalled = residuals[-1] <= _STALLED * tolerance
    advice = on_surface or "more steps, or a larger stabilisation"
    raise NoEquilibriumError(
        f"{residuals[-1]:.2g} N unbalanced after {most} iterations, "
        f"tolerance {tolerance:.2g} N",
        problem.around(problem.unfixed(f, u)),
        advice=LESS_ROUNDING if stalled else advice,
    )


def _first_tangent(problem: Problem, start: Start) -> tuple[Tangent, Parameters]:
    """The tangent at the start; where it is singular, that of fibres in tension.

    On surfaces the stiffnesses of the discretisation then are those of the tension that
    loads give: of a ply at rest they are too small where it is large.

    Returns
    -------
    tuple
        The tangent, and the parameters.

    Raises
    ------
    NoEquilibriumError
        If some motion meets no stiffness even so.
    """
    u, p = start.u, start.parameters
    regular = start.tangent and start.tangent.negative_pivots is not None
    if start.tangent and regular and not problem.surfaces:
        return start.tangent, p
    tension = problem.ply.geometric_tension(u, np.zeros_like(u), p)
    if regular:  # but surfaces have moved with the load factor
        return definite(problem, u, p, tension), p
    size = _FIRST_TENSION
    if problem.surfaces:
        of_loads = np.full_like(tension, _tension_of_loads(problem, start))
        p = problem.updated(p, u, of_loads)
        G = problem.ply.fabric.shear_law.tangent(np.zeros((tension.shape[1], 1))).mean()
        size = max(float(of_loads.max()), _OVER_SHEAR_STIFFNESS * G) or size
    first = np.full_like(tension, size)
    return Tangent(problem, u, p, first, contact=no_contact(problem)), p


def _tension_of_loads(problem: Problem, start: Start) -> float:
    """Tension in N/mm of the order that loads along surfaces give to fibres.

    That of a square with all of the loads on two of its sides.  With a tension that is
    ten times too large or too small a sphere takes twice the solves.
    """
    ply, u = problem.ply, start.u
    along = ply.nodal(problem.unfixed(problem.load(u, start.parameters), u))
    sides = 2 * np.sqrt(ply.basis.dx.sum())
    return float(np.linalg.norm(along, axis=0).sum() / sides)


def definite(
    problem: Problem,
    u: ndarray,
    parameters: Parameters,
    tension: ndarray,
    contact: ndarray | None = None,
) -> Tangent:
    """The tangent, with as little compression left out as makes it positive definite.

    Where that does not suffice, what resists shear is made convex in space.  Where
    nothing suffices it is returned as it is with all of that.

    Parameters
    ----------
    problem, u, parameters
        The problem, a displacement, and parameters of the terms.
    tension, contact
        As of `Tangent`.
    """
    shares = _COMPRESSION_SHARES if tension.min() < 0 else _COMPRESSION_SHARES[:1]
    attempts = [
        (np.where(tension > 0, tension, x * tension), False, contact) for x in shares
    ]
    if problem.in_space:
        least = 0.0, _FIRST_TENSION
        untouched = no_contact(problem)
        attempts += [(np.maximum(tension, x), True, untouched) for x in least]
    for number, attempt in enumerate(attempts, start=1):
        try:
            tangent = Tangent(problem, u, parameters, *attempt)
        except NoEquilibriumError:
            if number == len(attempts):
                raise
        else:
            if tangent.definite:
                break
    tangent.altered = number > 1 or not tangent.definite
    return tangent


def no_contact(problem: Problem) -> ndarray | None:
    """Multipliers 0 for nodes on surfaces; None where there are none."""
    return np.zeros(len(problem.surfaces.nodes)) if problem.surfaces else None


def within_laws(
    problem: Problem, u: ndarray, du: ndarray, parameters: Parameters
) -> ndarray:
    """The increment, halved until every law has a value.

    Raises
    ------
    NoEquilibriumError
        If none is short enough.
    """
    for _ in range(_HALVINGS_WITHIN_LAWS):
        if problem.in_domain(u + du, parameters):
            return du
        du = du / 2
    end = problem.ply.closest_end(u)
    raise NoEquilibriumError(
        "even the shortest increment passes the end of a law"
        + (f": {end}" if end else ""),
        end.elements if end else (),
        "a law that holds further (of a table: more points, or extrapolation=linear), "
        "or a smaller load",
        end.quantity if end else "",
    )


def _largest_gradient(problem: Problem, du: ndarray) -> float:
    ply = problem.ply
    return float(np.abs(ply.gradient(du, ply.fine_points)).max())


def _shortened(
    problem: Problem, u: ndarray, du: ndarray, f: ndarray, parameters: Parameters
) -> ndarray:
    """The increment, halved until the energy falls enough (Armijo).

    It may not fold the ply, nor fold it further if it is folded.
    """
    energy = problem.energy(u, parameters)
    slope = float(problem.free(f, u) @ problem.free(du, u))
    if slope > 0:  # the tangent was indefinite
        du, slope = -du, -slope
    unfolded = min(problem.least_area_ratio(u).min(), 0.0)
    for _ in range(_LINE_SEARCH_HALVINGS):
        allowed = energy + _ARMIJO * slope + _ROUND_OFF * abs(energy)
        end = problem.moved(u, du)
        if (
            problem.energy(end, parameters) <= allowed
            and problem.least_area_ratio(end).min() > unfolded
        ):
            return du
        du, slope = du / 2, slope / 2
    folded = problem.least_area_ratio(end) <= unfolded
    raise NoEquilibriumError(
        "no descent of the energy",
        np.flatnonzero(folded),
        advice="a larger stabilisation, a less distorted mesh or a smaller load",
    )
