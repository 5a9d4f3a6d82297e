"""Where yarns may slip: tension handed over at the crossings against their friction."""

from typing import Any

import numpy as np
import scipy  # whose modules are imported on first use
from numpy import ndarray
from skfem import (
    BilinearForm,
    CellBasis,
    Element,
    ElementQuad1,
    ElementTriP1,
    LinearForm,
    Mesh,
)
from skfem.helpers import dot, grad

from ..fabric.yarns import Yarns, friction_part
from ..forms.fields import FabricOnBasis
from .parameters import PlyParameters


def slip_index(
    ply: FabricOnBasis,
    u: ndarray,
    parameters: PlyParameters | None = None,
    yarns: Yarns | None = None,
) -> ndarray:
    """Force that a crossing hands over along a yarn, relative to what it can bear.

    Where the tension T of a fibre family changes along the fibres, by ∂T/∂s per length,
    the crossings hand over this force per area.  Friction bears at most M_f/r̄, with the
    friction part M_f of the shear moment and the mean distance r̄ of the points of a
    crossing from its centre (`Yarns.lever`).  The index is ``r̄ |∂T/∂s|/M_f``, the
    larger one of both families: above 1 the crossings of an element slip.  ∂T/∂s is
    averaged over a yarn spacing, by the filter q − ∇·(ℓ² ∇q) = ∂T/∂s with ℓ = half the
    spacing: beside a line on which the tension changes, its largest value is the mean
    over one spacing.

    Elements larger than the spacing average over more, and the index is too small.
    Forces on the outline are left out, because clamps may hold the yarns there.  A
    crossing with an index i below 1 that turns by dΓ also slides, by r̄ i/√(1 − i²) dΓ.

    Parameters
    ----------
    ply
        The ply.
    u, parameters
        Displacement and parameters of a `State`; see `Ply.fibre_tension`.
    yarns
        Yarns; by default of the fabric of the ply.

    Returns
    -------
    ndarray
        Shape (n_elements,), of the elements of ``ply.mesh``.

    Raises
    ------
    ValueError
        If there are no yarns, or neither they nor the shear law have friction.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Fabric, Ply, Yarns
    >>> yarns = Yarns((0.2, 0.2), (0.1, 0.1), friction_moment=0.5)
    >>> ply = Ply(MeshQuad().refined(5), Fabric(100.0, 1.0, yarns=yarns))
    >>> x, u = ply.nodes[0], ply.basis.zeros()
    >>> u[ply.basis.nodal_dofs[0]] = 0.5 * 0.01 * x**2  # the strain is 0.01 x
    >>> index = slip_index(ply, u)  # a force of 1 N/mm² is handed over everywhere
    >>> bool(abs(index.max() * yarns.bearing(0.5) - 1) < 0.01)
    True
    """
    yarns = ply.fabric.yarns if yarns is None else yarns
    if yarns is None:
        raise ValueError(
            "the slip index requires the yarns of the fabric: Fabric(..., yarns=Yarns("
            "spacing=..., width=...)), or shear.yarns in a case file"
        )
    moment = friction_of(ply, yarns)
    tension, weight = ply.fibre_tension(u, parameters), ply.basis.dx
    mean = (tension * weight).sum(axis=-1) / weight.sum(axis=-1)
    element = {3: ElementTriP1, 4: ElementQuad1}[len(ply.mesh.t)]()
    handed = []
    for i, a in enumerate(ply.directions(ply.centre)):
        along = np.broadcast_to(a[..., 0], (2, ply.mesh.nelements))
        half = 0.5 * yarns.spacing[1 - i], 0.5 * yarns.spacing[i]
        q = _averaged_derivative(ply.mesh, element, along, mean[i], half)
        handed.append(np.abs(q[ply.mesh.t].mean(axis=0)))
    return np.asarray(np.max(handed, axis=0) * yarns.lever / moment)


def slip_figures(
    ply: FabricOnBasis, u: ndarray, parameters: PlyParameters | None = None
) -> dict[str, float]:
    """Figures of `slip_index` for a summary; empty for a fabric without yarns.

    ``max_slip_index`` is exceeded on the area of one crossing, the smallest area on
    which the index has a meaning; ``slip_share_of_area`` is the area on which the index
    exceeds 1.
    """
    yarns = ply.fabric.yarns
    if yarns is None:
        return {}
    index = slip_index(ply, u, parameters)
    area = ply.basis.dx.sum(axis=1)
    order = np.argsort(-index)
    covered = np.cumsum(area[order])
    last = min(int(np.searchsorted(covered, np.prod(yarns.spacing))), index.size - 1)
    return {
        "max_slip_index": float(index[order[last]]),
        "slip_share_of_area": float(area[index > 1].sum() / covered[-1]),
    }


def friction_of(ply: FabricOnBasis, yarns: Yarns) -> float | ndarray:
    """Friction part of the shear moment, one number or one per element."""
    if yarns.friction_moment is not None:
        return yarns.friction_moment
    moment = friction_part(ply.fabric.at().shear_law, ply.mesh.nelements)
    if not moment.all():
        raise ValueError(
            "the shear law has no friction part, because its curve does not bend "
            "towards the axis of the angle: specify the friction_moment of the yarns"
        )
    return moment


def _averaged_derivative(
    mesh: Mesh, element: Element, along: ndarray, tension: ndarray, half: Any
) -> ndarray:
    """Derivative of a tension along the fibres, averaged, at the vertices in N/mm².

    Parameters
    ----------
    mesh, element
        Mesh, and element of the averaged derivative.
    along, tension
        Direction and tension of each element, shapes (2, n_elements) and (n_elements,).
    half
        Half the spacings along the fibres and across them in mm: ℓ of the filter.
    """
    basis = CellBasis(mesh, element)
    points, across = np.ones(basis.dx.shape[1]), np.stack([-along[1], along[0]])
    fields = {"a": along[..., None] * points, "b": across[..., None] * points}

    @LinearForm
    def weak_derivative(v: Any, w: Any) -> Any:
        return -w.T * dot(w.a, grad(v))

    @BilinearForm
    def averaging(u: Any, v: Any, w: Any) -> Any:
        ways = zip(half, (w.a, w.b), strict=True)
        return u * v + sum(
            ell**2 * dot(way, grad(u)) * dot(way, grad(v)) for ell, way in ways
        )

    force = weak_derivative.assemble(basis, T=tension[:, None] * points, **fields)
    force[mesh.boundary_nodes()] = 0.0  # there clamps may hold the yarns
    matrix = averaging.assemble(basis, **fields).tocsc()
    return np.asarray(scipy.sparse.linalg.spsolve(matrix, force))
