"""Stacks: several plies that are formed together."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from scipy.sparse import block_diag, csr_matrix

from ..declarations import ELASTIC_SLIP
from ..fabric.law import number
from ..mesh.bases import components, quad_basis
from ..mesh.splitting import joined
from ..mesh.user_input import real_numbers, shortened
from ..ply import Ply
from ..ply.amount import Amount, AmountLike, Limits
from ..ply.formulations import Quadrilaterals
from ..ply.parameters import PlyParameters, Values
from ..ply.terms import Load, Term
from ..solve.states import State
from .between_plies import PlyContact
from .holder import HolderPressure
from .layers import Layer, Layers
from .obstacle import ToolTerm
from .risks import pressure_of

_FRICTION = "friction between plies"

# Distance from an element, in reference coordinates, that is round-off.
_ROUND_OFF = 1e-6


class Stack(Ply):
    """Plies that lie on each other and are formed together, as one ply in space.

    The plies keep their own meshes, fabrics and outlines.  Each touches those above and
    below it, and the tools where no other ply is between.  A boundary of the same name
    is one boundary of the stack, ``ply 1: NAME`` the one of the lowest ply.  Angles,
    strains and tensions are fields over the elements of all plies, in their order.

    Parameters
    ----------
    plies
        The plies from the lowest, in space, without terms, and with the same
        formulation of quadrilaterals.
    friction
        Coefficient of Coulomb friction between plies, at least 0, or a function of the
        load factor; or a symmetric table, shape (n_plies, n_plies), of which the
        diagonal is not used.
    elastic_slip
        Slip in mm up to which friction is elastic.
    thickness
        Thickness of the plies in mm, one or each: they lie on each other, and half of
        their thickness from tools, which state none.  By default all lie in one plane.
    terms
        Tools and loads, see `Ply`.

    Attributes
    ----------
    plies
        The plies.
    layers
        Their places.

    Raises
    ------
    ValueError
        If there are less than two plies, they are in the plane, have terms or different
        formulations or planes of symmetry, or none is on another; or a number or the
        table is not valid.

    Examples
    --------
    Two plies, the upper one at 45°, that a sphere pushes up:

    >>> from skfem import MeshQuad
    >>> from skfem_textile import Fabric, Ply, Stack, Tool, drape
    >>> mesh = MeshQuad().refined(3).translated((-0.5, -0.5)).scaled(100.0)
    >>> fabrics = [Fabric(1e3, 0.1, bending=(1.0, 1.0), warp=x, weft=y)
    ...     for x, y in (((1, 0), (0, 1)), ((1, 1), (-1, 1)))]
    >>> plies = [Ply(mesh.with_defaults(), x, dimension=3) for x in fabrics]
    >>> punch = Tool(drape.Sphere(30.0, (0, 0, -30)), motion=(0, 0, 10), name="punch")
    >>> Stack(plies, friction=0.2, terms=[punch]).part(2).stop
    512
    """

    def __init__(
        self,
        plies: Sequence[Ply],
        *,
        friction: AmountLike | ArrayLike = 0.0,
        elastic_slip: float = ELASTIC_SLIP,
        thickness: float | Sequence[float] = 0.0,
        terms: Iterable[Term | Load] = (),
    ) -> None:
        self.plies = plies = tuple(plies)
        _refuse_plies(plies)
        first = plies[0]
        self.friction = _table(friction, len(plies))
        self.elastic_slip = number("elastic slip between plies", elastic_slip, above=0)
        self.mesh = self.users_mesh = joined([ply.mesh for ply in plies], "ply")
        formulation: Any = first.formulation
        self.basis = quad_basis(self.mesh, formulation.rule, 3)
        counts = [ply.mesh.p.shape[1] for ply in plies]
        elements = [ply.mesh.nelements for ply in plies]
        basis: Any = self.basis
        basis.layers = self.layers = Layers(
            basis, counts, elements, _thickness(thickness, len(plies))
        )
        fabrics = {f"ply {i}": ply.fabric for i, ply in enumerate(plies, 1)}
        self._build(fabrics, formulation, tuple(terms), first.fibre_ends)

    def _needed_terms(self, tension: Any, corners: Any) -> list[Term]:
        """Also the contacts of plies that lie on each other."""
        pairs = combinations(range(len(self.plies)), 2)
        contacts = [
            PlyContact(self.layers, pair) for pair in pairs if self.layers.faces(*pair)
        ]
        if not contacts:
            raise ValueError("stack: no ply lies on another: check their positions")
        for contact in contacts:
            coefficient = self.friction[contact.between]
            if callable(coefficient) or coefficient:
                amount = Amount(_FRICTION, coefficient, Limits(0.0))
                amount(0.0)  # refuses other values
                contact.with_friction(amount, self.elastic_slip)
        return [*super()._needed_terms(tension, corners), *contacts]

    @property
    def contacts(self) -> list[PlyContact]:
        """Contacts of plies with each other."""
        return [x for x in self.terms if isinstance(x, PlyContact)]

    def part(self, number: int) -> slice:
        """Elements of a ply, numbered from 1 for the lowest."""
        elements = self.layers.elements(number - 1)
        return slice(int(elements[0]), int(elements[-1]) + 1)

    def nodes_of(self, number: int) -> slice:
        """Nodes of a ply, numbered from 1 for the lowest."""
        nodes = np.flatnonzero(self.layers.ply == number - 1)
        return slice(int(nodes[0]), int(nodes[-1]) + 1)

    def hat_functions(self) -> csr_matrix:
        """See `Ply.hat_functions`; the plies are apart."""
        return csr_matrix(block_diag([ply.hat_functions() for ply in self.plies]))

    @cached_property
    def with_tools(self) -> "list[PlyOfStack]":
        """The plies from the lowest, where they lie, with the tools of the stack."""
        return [PlyOfStack(self, i) for i in range(1, len(self.plies) + 1)]

    def values_of(self, number: int, parameters: PlyParameters) -> PlyParameters:
        """Parameters of a ply of ``with_tools``, numbered from 1, from the stack's."""
        every, at = self.with_tools, number - 1
        counts = [
            (x.nodes.shape[1], x.mesh.nelements, 1 + int(x.parent.max())) for x in every
        ]
        sizes = np.array(counts)
        rows = zip(sizes.sum(axis=0), sizes[at], sizes[:at].sum(axis=0), strict=True)
        parts = {(n, size): slice(start, start + size) for n, size, start in rows}

        def cut(value: ndarray, like: ndarray) -> ndarray:
            pairs = zip(value.shape, like.shape, strict=True)
            return value[tuple(slice(a) if a == b else parts[a, b] for a, b in pairs)]

        return {
            name: Values(
                {key: cut(parameters[name][key], x) for key, x in at_rest.items()}
            )
            for name, at_rest in every[at].parameters_at_rest.items()
        }

    def gap(self, state: State, number: int) -> ndarray:
        """Distance of a ply from the one above it in mm, shape (n_nodes,) of the ply.

        NaN where there is none.

        Parameters
        ----------
        state
            State of the stack.
        number
            Number of the ply, 1 for the lowest.
        """
        return self._above(state, number)[0]

    def slip(self, state: State, number: int, above: int | None = None) -> ndarray:
        """Slip of a ply under the one above it in mm, shape (n_nodes,) of the ply.

        The distance at rest, along the plies, of the points that are now on each other;
        NaN where no ply is above.  Parameters as in `gap`; ``above`` is the number of
        the ply above, by default the nearest one.
        """
        return self._above(state, number, above)[1]

    def pressure(self, state: State, number: int) -> ndarray:
        """Pressure between a ply and those above it in N/mm², as in `tool_pressure`.

        Shape (n_nodes,) of the ply; NaN where no ply is above.  Parameters as in `gap`.
        """
        u, at, force = state.u, self.nodes_of(number), np.zeros(self.nodes.shape[1])
        for contact in self.contacts:
            if contact.between[0] == number - 1:
                values = state.parameters[contact.name]
                f = contact.relative(u).T @ contact.forces(u, state.load_factor, values)
                force += f if contact.rows[0] in range(at.start, at.stop) else -f
        ply = self.with_tools[number - 1]
        of_ply = ply.basis.zeros() + self.nodal(u)[:, at].T.ravel()
        pressure = pressure_of(ply, of_ply, np.maximum(force[at], 0.0))
        return np.where(np.isnan(self.gap(state, number)), np.nan, pressure)

    def _above(
        self, state: State, number: int, above: int | None = None
    ) -> tuple[ndarray, ndarray]:
        """Gap and slip of a ply to one above, by default to the nearest one."""
        self.refuse_other(state.u)
        self._refuse_number(number)
        layers, low, at = self.layers, number - 1, self.nodes_of(number)
        x, X = layers.points.in_planes(state.u), self.at_rest[:2]
        gap, slip = np.full((2, at.stop - at.start), np.nan)
        for high in [above - 1] if above else range(number, len(self.plies)):
            feet = layers.surfaces[high].feet(x, x[:, at])
            apart = 0.5 * (layers.thickness[low] + layers.thickness[high])
            here = -feet.heights(x[:, at]) - apart
            under = (feet.off <= _ROUND_OFF) & layers.bare(low, high)[at]
            nearer = under & ~(gap <= here)
            moved = (feet.weights * X[:, feet.nodes]).sum(axis=1) - X[:, at]
            gap[nearer] = here[nearer]
            slip[nearer] = np.hypot(*moved)[nearer]
        return gap, slip

    def _refuse_number(self, number: int) -> None:
        """Refuse numbers that no ply has."""
        if number not in range(1, len(self.plies) + 1):
            raise ValueError(
                f"the stack has plies 1 (lowest) to {len(self.plies)}, not {number!r}"
            )


class PlyOfStack(Ply):
    """Ply of a stack where it lies, with the tools of the stack and no other load.

    Parameters
    ----------
    stack
        The stack.
    number
        Number of the ply, 1 for the lowest.
    """

    def __init__(self, stack: Stack, number: int) -> None:
        ply = stack.plies[number - 1]
        formulation: Any = ply.formulation
        self.users_mesh, self.mesh = ply.users_mesh, ply.mesh
        self.basis = quad_basis(self.mesh, formulation.rule, 3)
        basis: Any = self.basis
        basis.layers = Layer(stack.layers, number - 1)
        tools = [_ToolOfStack(x) for x in stack.terms if isinstance(x, ToolTerm)]
        self._build(ply.fabric, formulation, tools, ply.fibre_ends)

    def contradictions(self, states: Sequence[Any]) -> list[str]:
        """None: tools may touch other plies only."""
        return []


class _ToolOfStack(NamedTuple):
    """Tool of a stack for one of its plies."""

    term: Any

    def on(self, basis: Any) -> ToolTerm:
        """Term on the basis of the ply, see `Load`."""
        term = self.term
        obstacle = replace(term._obstacle, X=basis.layers.X)
        amount = (term._pressure,) if isinstance(term, HolderPressure) else ()
        tool: ToolTerm = type(term)(term.name, *amount, obstacle, basis)
        if rubs := term.friction:
            tool.with_friction(rubs._coefficient, rubs.slip)
        tool.amounts = term.amounts
        return tool


def _refuse_plies(plies: Sequence[Ply]) -> None:
    """Refuse plies that cannot be one stack."""
    if len(plies) < 2:
        raise ValueError(f"a stack needs at least two plies, got {len(plies)}")
    for i, ply in enumerate(plies, 1):
        if not isinstance(ply, Ply):
            raise ValueError(f"stack: ply {i} must be a Ply, got {shortened(ply)}")
        if components(ply.basis) != 3:
            raise ValueError(f"stack: ply {i} is in its plane: use dimension=3")
        if not isinstance(ply.formulation, Quadrilaterals):
            raise ValueError(
                f"stack: ply {i} has the formulation {ply.formulation.name!r}: use one "
                "of quadrilaterals, such as Macro()"
            )
        if ply.formulation != plies[0].formulation:
            raise ValueError(
                f"stack: the formulations of plies 1 and {i} differ: use one for all"
            )
        if ply.user_terms:
            names = ", ".join(repr(x.name) for x in ply.further_terms)
            raise ValueError(
                f"stack: ply {i} has terms, {names}: add them to the stack, "
                "Stack(..., terms=[...])"
            )
        if ply.fibre_ends != plies[0].fibre_ends:
            raise ValueError(
                f"stack: the fibre ends of plies 1 and {i} differ: use the same"
            )


def _thickness(thickness: float | Sequence[float], n: int) -> ndarray:
    """Thickness of each of n plies in mm."""
    every = real_numbers("stack: thickness", thickness)
    if every.shape not in ((), (n,)):
        raise ValueError(f"stack: {every.size} thicknesses for {n} plies: one for each")
    if not (np.isfinite(every).all() and (every >= 0).all()):
        raise ValueError(
            "stack: a thickness must be a number of at least 0 mm, got "
            f"{shortened(thickness)}"
        )
    return np.broadcast_to(every, (n,)).astype(float)


def _table(friction: Any, n: int) -> ndarray:
    """Coefficient of friction of each pair of n plies, shape (n, n)."""
    if callable(friction) or np.ndim(friction) == 0:
        return np.full((n, n), friction, dtype=object)
    rows = [len(row) if np.ndim(row) else 1 for row in friction]
    if rows != [n] * n:
        raise ValueError(
            f"{_FRICTION}: a table for {n} plies needs {n} rows of {n} coefficients, "
            f"got {shortened(friction)}"
        )
    table = np.array(friction, dtype=object)
    for i, j in combinations(range(n), 2):
        if table[i, j] is None or table[i, j] != table[j, i]:
            raise ValueError(
                f"{_FRICTION}: the table must be symmetric, but plies {i + 1} and "
                f"{j + 1} have {table[i, j]!r} and {table[j, i]!r}"
            )
    return table
