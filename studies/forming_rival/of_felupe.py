"""The hemisphere in FElupe: Newton's method with its line search on the residual.

FElupe assembles fibres, shear and the stabilisation of shear.  This library supplies
the other terms: bending, stabilisation across the ply, edges, and tools as penalties.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

from skfem_textile.contact.obstacle import ToolContact
from skfem_textile.fabric import kinematics as kin
from skfem_textile.ply import Ply
from skfem_textile.ply.parameters import NO_VALUES, Values
from skfem_textile.solve.conditions import Constraints

from ..common.rivals.course import Course, formed
from ..common.rivals.forming import Forming
from .ours import held, ply_of

# Relative residual of a state, and largest number of iterations of a step.
_TOLERANCE, _MOST = 1e-8, 150

#: Terms that FElupe assembles.
OF_FELUPE = "tension", "shear", "stabilisation"


class Membrane:
    """Item of FElupe: fibres and shear at one point, stabilisation at 2×2 points."""

    def __init__(self, case: Forming, ply: Ply) -> None:
        import felupe

        mesh = felupe.Mesh(ply.mesh.p.T, ply.mesh.t[::-1].T, "quad")  # anticlockwise
        regions = [
            felupe.Region(mesh, felupe.Quad(), felupe.GaussLegendre(order, dim=2))
            for order in (0, 1, 1)
        ]
        centre, _, of_centre = regions
        of_centre.dhdX = np.repeat(centre.dhdX, 4, axis=2)  # at all 2×2 points
        self._fields = [
            felupe.FieldContainer([felupe.Field(region, dim=3)]) for region in regions
        ]
        self._form, self._case = felupe.IntegralForm, case
        self.field, self.tangents = self._fields[0], 0
        self.results = SimpleNamespace(update_statevars=lambda: None)
        self.assemble = SimpleNamespace(
            vector=self._vector, matrix=self._matrix, multiplier=None
        )

    def _gradients(self) -> list[ndarray]:
        for other in self._fields[1:]:
            other[0].values[:] = self.field[0].values
        return [kin.deformation_gradient(field[0].grad()) for field in self._fields]

    def _vector(self, field: Any = None, parallel: bool = False) -> csr_matrix:
        at_one, *at_four = self._gradients()
        case, moment = self._case, self._case.C_s * _difference(at_four)
        stresses = [
            case.G * _angle(at_one) * _angle_d(at_one)
            + sum(
                case.E * kin.fibre_strain(at_one, a) * kin.fibre_strain_d(at_one, a)
                for a in _FIBRES
            ),
            moment * _angle_d(at_four[0]),
            -moment * _angle_d(at_four[1]),
        ]
        return sum(
            self._form([P], field, field.region.dV).assemble()
            for P, field in zip(stresses, self._fields, strict=True)
        )

    def _matrix(self, field: Any = None, parallel: bool = False) -> csr_matrix:
        self.tangents += 1
        at_one, *at_four = self._gradients()
        E, G, C_s = self._case.E, self._case.G, self._case.C_s
        K: Any = G * (
            _outer(_angle_d(at_one), _angle_d(at_one))
            + _angle(at_one) * kin.shear_angle_dd(at_one, *_FIBRES)
        )
        for a in _FIBRES:
            d = kin.fibre_strain_d(at_one, a)
            K = K + E * _outer(d, d)
            K = K + E * kin.fibre_strain(at_one, a) * kin.fibre_strain_dd(at_one, a)
        total = self._of(K, 0, 0)
        moment = C_s * _difference(at_four)
        turns = [_angle_d(at_four[0]), -_angle_d(at_four[1])]
        for i in range(2):
            for j in range(2):
                K = C_s * _outer(turns[i], turns[j])
                if i == j:
                    second = kin.shear_angle_dd(at_four[i], *_FIBRES)
                    K = K + (-1) ** i * moment * second
                total = total + self._of(K, 1 + i, 1 + j)
        return total

    def _of(self, K: ndarray, i: int, j: int) -> csr_matrix:
        v, u = self._fields[i], self._fields[j]
        return self._form([K], v, v.region.dV, u).assemble()


_FIBRES = np.reshape([1.0, 0.0], (2, 1, 1)), np.reshape([0.0, 1.0], (2, 1, 1))


def _angle(F: ndarray) -> ndarray:
    return kin.shear_angle(F, *_FIBRES)


def _angle_d(F: ndarray) -> ndarray:
    return kin.shear_angle_d(F, *_FIBRES)


def _difference(gradients: list[ndarray]) -> ndarray:
    return _angle(gradients[0]) - _angle(gradients[1])


def _outer(S: ndarray, T: ndarray) -> ndarray:
    return np.einsum("iJ...,kL...->iJkL...", S, T)


class Penalty:
    """Tool of this library with a penalty in N/mm³ in place of the constraint."""

    def __init__(self, tool: ToolContact, stiffness: float) -> None:
        self._tool, self._values = tool, {"stiffness": stiffness * tool.areas}

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Forces of the depths of the nodes inside the tool."""
        return self._tool.residual(u, t, self._with(np.zeros_like(self._tool.areas)))

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix | None:
        """Their derivative, which is the tangent of a tool with these forces."""
        free = self._with(np.zeros_like(self._tool.areas))
        return self._tool.tangent(u, t, self._with(self._tool.forces(u, t, free)))

    def _with(self, forces: ndarray) -> Values:
        return Values({**self._values, "force": forces})


class Terms:
    """Item of FElupe: terms of this library, and penalties, at a load factor."""

    def __init__(self, field: Any, terms: list[Any]) -> None:
        self.field, self._terms, self.load_factor = field, terms, 0.0
        self.results = SimpleNamespace(update_statevars=lambda: None)
        self.assemble = SimpleNamespace(
            vector=self._vector, matrix=self._matrix, multiplier=None
        )

    def _vector(self, field: Any = None, parallel: bool = False) -> csr_matrix:
        u, t = self.field[0].values.ravel(), self.load_factor
        f = np.sum([term.residual(u, t, NO_VALUES) for term in self._terms], axis=0)
        return csr_matrix(f[:, None])

    def _matrix(self, field: Any = None, parallel: bool = False) -> csr_matrix:
        u, t = self.field[0].values.ravel(), self.load_factor
        tangents = (term.tangent(u, t, NO_VALUES) for term in self._terms)
        return csr_matrix(sum(K for K in tangents if K is not None))


def _solver() -> Any:
    """PARDISO, or SciPy's SuperLU."""
    try:
        import pypardiso
    except ImportError:
        from scipy.sparse.linalg import spsolve

        return spsolve
    return pypardiso.spsolve


def felupe(case: Forming, steps: int) -> Course:
    """Form a ply with FElupe.

    Parameters
    ----------
    case, steps
        See `forming.dolfinx`.
    """
    import felupe

    ply = ply_of(case)
    fixed = Constraints(ply.basis, held()).fixed
    membrane = Membrane(case, ply)
    others: dict[str, Any] = {
        term.name: Penalty(term, case.penalty)
        if isinstance(term, ToolContact)
        else term
        for term in ply.terms
        if term.name not in OF_FELUPE
    }
    terms = Terms(membrane.field.copy(), [*others.values()])
    arguments = {
        "items": [membrane, terms],
        "dof0": fixed,
        "dof1": np.setdiff1d(np.arange(ply.basis.N), fixed),
        "ext0": np.zeros(len(fixed)),
        "maxiter": _MOST,
        "tol": _TOLERANCE,
        "solver": _solver(),
        "verbose": 0,
        "plugins": [felupe.LinesearchPlugin(admissible=False)],
    }

    def search(u: ndarray, travel: float) -> tuple[ndarray | None, int]:
        start, before = membrane.field.copy(), membrane.tangents
        start[0].values[:] = u.reshape(-1, 3)
        terms.load_factor = travel / case.depth
        try:
            result = felupe.newtonraphson(x0=start, **arguments)
        except felupe.NewtonConvergenceError:
            return None, membrane.tangents - before
        return result.x[0].values.ravel(), result.iterations

    def force(u: ndarray, travel: float) -> float:
        return -float(others["punch"].residual(u, travel / case.depth)[2::3].sum())

    nodes, travels = ply.nodes.T, case.travels(steps)
    return Course.of(*formed(nodes, search, force, travels))
