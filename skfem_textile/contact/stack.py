"""Stacks: several plies that are formed together."""

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..declarations import ELASTIC_SLIP
from ..fabric.law import number
from ..mesh.bases import components, quad_basis
from ..mesh.splitting import joined
from ..mesh.user_input import real_numbers, shortened
from ..ply import Ply
from ..ply.amount import Amount, AmountLike, Limits
from ..ply.formulations import Quadrilaterals
from ..ply.terms import Load, Term
from .between_plies import PlyContact
from .layers import Layers

_FRICTION = "friction between plies"


class Stack(Ply):
    """Plies that lie on each other and are formed together, as one ply in space.

    The plies keep their own meshes, fabrics and outlines.  Each touches those above and
    below it, and the tools where no other ply is between.  A boundary of the same name
    is one boundary of the stack, ``ply 1: NAME`` that of the lowest ply alone.  Angles,
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
                amount(0.0)  # refuses what is no coefficient
                contact.with_friction(amount, self.elastic_slip)
        return [*super()._needed_terms(tension, corners), *contacts]

    @property
    def at_rest(self) -> ndarray:
        """See `Ply.at_rest`."""
        return self.layers.X

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
                f"stack: ply {i} has terms of its own, {names}: add them to the stack, "
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
