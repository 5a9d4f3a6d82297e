"""Macro-elements: the whole fibre stiffness on the mean strain of what was split.

One point in every quadrilateral asks as much of nearly inextensible fibres as there
are unknowns to give.  On meshes off the fibres that still locks where the shear angle
jumps, along fibres as stiff as those of real fabrics.  A macro-element, the
quadrilaterals that were split off one element, asks less: the fibres' own law holds
for their mean strain ε̄, and what deviates from it meets a stiffness E_d that is large
beside that of shear but does not grow with that of the fibres,

    ψ(ε̄) + ½ E_d (ε − ε̄)².

It is consistent: a deviation vanishes with the size of the elements.
"""

from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import (
    BilinearForm,
    CellBasis,
    DiscreteField,
    ElementQuad1,
    ElementVector,
    Functional,
    LinearForm,
)
from skfem.assembly.form.form import FormExtraParams
from skfem.helpers import ddot, grad

from . import kinematics as kin
from .elements import CENTRE
from .fabric import Fabric, is_zero
from .forms import Forms, contract, directions, fibre_tension, once
from .splitting import SplitMesh

# E_d as a multiple of the shear stiffness at rest, or of that of the fibres.
_OF_SHEAR, _OF_FIBRES = 1.5e4, 0.5


class MacroBasis(CellBasis):
    """Basis of the displacement on the elements that a mesh was split off.

    An element's points are the centres of its quadrilaterals, each with the weight of
    their area, and its functions those of all of their nodes.  Forms find the share of
    each point in the area of its element as ``w["share"]``.

    Parameters
    ----------
    mesh
        Quadrilaterals that were split off other elements.
    **kwargs
        Passed to `skfem.CellBasis`: ``mapping``, ``dofs``.

    Attributes
    ----------
    parts
        Numbers of the quadrilaterals of each element, shape (n_elements, n_points);
        −1 where an element has fewer than others.
    """

    def __init__(self, mesh: SplitMesh, **kwargs: Any) -> None:
        element = ElementVector(ElementQuad1())
        super().__init__(mesh, element, quadrature=CENTRE, **kwargs)
        bilinear: Any = self.basis
        x = np.asarray(self.global_coordinates())
        self.parts = _parts(mesh.parent)
        there = self.parts >= 0
        self.nelems, n_points = self.parts.shape
        self.X = np.repeat(self.X, n_points, axis=1)
        self.dx = np.where(there, self.dx[self.parts, 0], 0.0)
        self._global_coordinates = DiscreteField(x[:, self.parts, 0])

        # Nodes of an element, and for each node of its parts which of them it is.
        nodes = np.where(there, mesh.t[:, self.parts], mesh.t[:, self.parts[:, :1]])
        own, which = _distinct(nodes.transpose(0, 2, 1).reshape(-1, self.nelems))
        which = which.reshape(4, n_points, self.nelems)
        dofs = self.nodal_dofs[:, own].transpose(1, 0, 2)
        self._element_dofs = dofs.reshape(-1, self.nelems)
        self.Nbfun = len(self._element_dofs)

        values = np.zeros((len(own), self.nelems, n_points))
        gradients = np.zeros((len(own), 2, self.nelems, n_points))
        for i, j in product(range(4), range(n_points)):
            some = np.flatnonzero(there[:, j])
            a, part = which[i, j, some], self.parts[some, j]
            values[a, some, j] = 0.25
            gradients[a, :, some, j] = bilinear[2 * i][0].grad[0, :, part, 0]
        self.basis = [
            (_along(axis, N, dN),)
            for N, dN in zip(values, gradients, strict=True)
            for axis in range(2)
        ]

    def default_parameters(self) -> dict[str, Any]:
        """Position, quadrilateral, and share in the area of the element."""
        share = self.dx / self.dx.sum(axis=1, keepdims=True)
        return {"x": self.global_coordinates(), "element": self.parts, "share": share}

    def of_parts(self, x: ndarray) -> ndarray:
        """Values of the quadrilaterals, (..., n, 1), as values at the points."""
        return np.where(self.parts >= 0, x[..., self.parts, 0], 0.0)

    def on_parts(self, x: ndarray) -> ndarray:
        """Values at the points as values of the quadrilaterals, (..., n, 1)."""
        there = self.parts >= 0
        y = np.empty((*x.shape[:-2], there.sum(), 1))
        y[..., self.parts[there], 0] = x[..., there]
        return y


def macro_tension(fabric: Fabric) -> Forms:
    """Fibre tension of macro-elements, with the energy ψ(ε̄) + ½ E_d (ε − ε̄)².

    The forms go with `MacroBasis`.  The tangent takes an optional parameter
    ``tension``, shape (2, n_elements, n_points), as that of `tension` does.
    """
    # Index, tension law T(ε) and E_d of each family that has a law.
    families = [
        (i, family.tension, E_d)
        for i, (family, E_d) in enumerate(
            zip(fabric.families, deviation_stiffness(fabric), strict=True)
        )
        if not is_zero(family.tension)
    ]

    def strains(w):
        F, A = _F(w), directions(fabric, w)
        return {i: kin.fibre_strain(F, A[i]) for i, *_ in families}

    def variations(w):
        F, A = _F(w), directions(fabric, w)
        return {i: kin.fibre_strain_d(F, A[i]) for i, *_ in families}

    def stress(w):
        eps, d_eps = strains(w), once(w, variations)
        return sum(
            (T.value(_mean(w, eps[i])) + E_d * (eps[i] - _mean(w, eps[i]))) * d_eps[i]
            for i, T, E_d in families
        )

    def local_stiffness(w):
        """What couples the motions of one part alone."""
        F, A, eps, d_eps = _F(w), directions(fabric, w), strains(w), once(w, variations)
        C = np.zeros(1)
        for i, T, E_d in families:
            mean = _mean(w, eps[i])
            own = T.value(mean) + E_d * (eps[i] - mean)
            geometric = w["tension"][i] if "tension" in w else own
            C = C + E_d * np.einsum("iJ...,kL...->iJkL...", d_eps[i], d_eps[i])
            C = C + geometric * kin.fibre_strain_dd(F, A[i])
        return C

    def mean_stiffness(w):
        eps = strains(w)
        return {i: T.tangent(_mean(w, eps[i])) - E_d for i, T, E_d in families}

    @Functional
    def energy(w):
        eps = strains(w)
        return sum(
            T.energy(_mean(w, eps[i])) + 0.5 * E_d * (eps[i] - _mean(w, eps[i])) ** 2
            for i, T, E_d in families
        )

    @LinearForm
    def residual(v, w):
        return ddot(once(w, stress), grad(v))

    @BilinearForm
    def tangent(u, v, w):
        d_eps, E_m = once(w, variations), once(w, mean_stiffness)
        means = (
            E_m[i]
            * _mean(w, ddot(d_eps[i], grad(u)))
            * _mean(w, ddot(d_eps[i], grad(v)))
            for i, *_ in families
        )
        return sum(means) + contract(grad(v), once(w, local_stiffness), grad(u))

    return Forms(energy, residual, tangent)


def macro_fibre_tension(
    fabric: Fabric, basis: MacroBasis, strain: ndarray, change: ndarray | float = 0.0
) -> ndarray:
    """Tensions T(ε̄) + E_d (ε − ε̄) of warp and weft after a change of the strains.

    Parameters
    ----------
    fabric
        Gives the laws.
    basis
        The macro-elements.
    strain, change
        Fibre strains of the quadrilaterals and a change of them, to first order in
        which the tensions are given; shape (2, n, 1).
    """
    w = basis.default_parameters()
    eps, d_eps = (basis.of_parts(x + np.zeros_like(strain)) for x in (strain, change))
    mean, d_mean = _mean(w, eps), _mean(w, d_eps)
    E_d = np.reshape(deviation_stiffness(fabric), (2, 1, 1))
    deviation = eps + d_eps - mean - d_mean
    return basis.on_parts(fibre_tension(fabric, mean, d_mean) + E_d * deviation)


def deviation_stiffness(fabric: Fabric) -> tuple[float, float]:
    """E_d of warp and weft in N/mm, never more than the fibre stiffness at rest.

    1.5·10⁴ times the shear stiffness at rest; half of the fibre stiffness where there
    is no shear stiffness.
    """
    G = float(fabric.shear_law.tangent(np.zeros(1))[0])
    stiffnesses = [float(f.tension.tangent(np.zeros(1))[0]) for f in fabric.families]
    warp, weft = (
        min(E, _OF_SHEAR * G) if G > 0 else _OF_FIBRES * E for E in stiffnesses
    )
    return warp, weft


def _mean(w: Any, x: ndarray) -> ndarray:
    """Mean over each element."""
    return (w["share"] * x).sum(axis=-1, keepdims=True)


def _F(w: FormExtraParams) -> ndarray:
    return kin.deformation_gradient(grad(w["u"]))


def _along(axis: int, N: ndarray, dN: ndarray) -> DiscreteField:
    """A function that displaces along one axis."""
    value, gradient = np.zeros((2, *N.shape)), np.zeros((2, *dN.shape))
    value[axis], gradient[axis] = N, dN
    return DiscreteField(value, gradient)


def _parts(parent: ndarray) -> ndarray:
    """Parts of each parent, shape (n_parents, most), −1 where there are fewer."""
    order, counts = np.argsort(parent, kind="stable"), np.bincount(parent)
    parts = np.full((len(counts), counts.max()), -1)
    parts[np.arange(counts.max()) < counts[:, None]] = order
    return parts


def _distinct(nodes: ndarray) -> tuple[ndarray, ndarray]:
    """The distinct nodes of each column, and for each entry which of them it is.

    Columns with fewer distinct nodes than others repeat their first.
    """
    order = np.argsort(nodes, axis=0, kind="stable")
    ascending = np.take_along_axis(nodes, order, axis=0)
    new = np.ones_like(ascending, dtype=bool)
    new[1:] = ascending[1:] != ascending[:-1]
    rank, which = new.cumsum(axis=0) - 1, np.empty_like(nodes)
    np.put_along_axis(which, order, rank, axis=0)
    own = np.repeat(ascending[:1], rank.max() + 1, axis=0)
    np.put_along_axis(own, rank, ascending, axis=0)
    return own, which
