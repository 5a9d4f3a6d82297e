"""Formulations: element, integration points and stabilisation."""

from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, ClassVar, TypeAlias, get_args

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementQuad1, ElementTriP1, Mesh

from .. import declarations as declared
from .. import forms
from ..fabric import Fabric
from ..mesh.bases import (
    CENTRE,
    GAUSS,
    SIX,
    THREE,
    HourglassBasis,
    JumpBasis,
    MacroBasis,
    MeanBasis,
    components,
    element_numbers,
    quad_basis,
    triangle_basis,
)
from ..mesh.checks import MeshError, check_mesh
from ..mesh.selection import SINGULAR
from ..mesh.splitting import SplitMesh, cut, split, was_split
from ..mesh.user_input import shortened
from .builtin_terms import OutOfPlane
from .parameters import (
    AccumulatedMoment,
    HeldDeviation,
    HeldStabilisation,
    TermParameters,
    Values,
    with_slip_of,
)
from .terms import FormTerm, TensionTerm, Term

# Twist stiffness relative to the smaller bending stiffness, if both families have one:
# with independently bending fibres the only remaining mechanism of the ply is z = xy.
# It adds 0.1 % to the load under which a square plate buckles.
_TWIST_OVER_BENDING = 0.002


class Pointwise:
    """Tension from the local strain at every point, without stabilisation."""

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """Tension T(ε) at every point."""
        slip = with_slip_of(None, fabric, basis, "tension")
        return TensionTerm("tension", forms.tension(fabric), basis, parameters=slip)

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """None."""
        return []


class Quadrilaterals(Pointwise):
    """Bilinear quadrilaterals, checked at the 2×2 points."""

    rule: ClassVar[tuple[ndarray, ndarray]]
    fine_points: ClassVar[ndarray] = GAUSS[0]

    def working_mesh(self, mesh: Mesh) -> Mesh:
        """Quadrilaterals unchanged, triangles split."""
        if getattr(mesh, "elem", None) is not ElementTriP1:
            return mesh
        check_mesh(mesh)
        return split(mesh)

    def basis(self, mesh: Mesh, dimension: int = 2) -> CellBasis:
        """Basis of the displacement."""
        check_mesh(mesh)
        return quad_basis(mesh, self.rule, dimension)


# Factor of `layer_stiffness`.  Calibrated with bias extensions at 35°, 45° and 55°: it
# changes the load by 1 % if it changes by a third.
_ON_SINGULAR = 4.0

# Length of an edge along a fibre over the height of a triangle beside it, from which on
# the triangle resolves the layer of the fibre.  Chosen by `python -m studies
# singular_fibres --case "chosen *"`.
_LONG = 2.0

# Sine of the angle to a fibre below which an edge follows it.
_FOLLOWS = 1e-3


def mean_tension_term(
    fabric: Fabric, deviation: float | ndarray, basis: MeanBasis, parent: ndarray
) -> TensionTerm:
    """Fibre tension term whose full stiffness acts on mean stretches only.

    In triangles that resolve the layer of a singular fibre it acts on all stretches of
    fibres along the layer.  ``parent`` is the element of the basis that contains each
    element of the mesh.
    """
    area = basis.dx.sum(axis=1, keepdims=True)
    layer = np.zeros((2, basis.nelems, 1))
    if components(basis) == 2 and (on := _at_singular_fibres(basis.mesh)).size:
        layer[:, parent[on]] = _ON_SINGULAR * np.sqrt(area.sum() / area[parent[on]])
        if basis.parts is None:
            resolved = _resolved(fabric, basis)
            layer[resolved[::-1]] = 0.0
            layer[resolved] = np.inf
    held = HeldDeviation(fabric, deviation, basis, layer)
    return TensionTerm(
        "tension",
        forms.mean_tension(fabric),
        basis,
        parameters=with_slip_of(held, fabric, basis, "tension"),
        of_means=Values({"E_d": np.zeros_like(layer)}),
    )


def _singular_edges(mesh: Mesh) -> ndarray:
    """Numbers of the edges on singular fibres."""
    return np.asarray((mesh.boundaries or {}).get(SINGULAR, ()), dtype=int)


def _at_singular_fibres(mesh: Mesh) -> ndarray:
    """Numbers of the elements with an edge on a singular fibre."""
    elements = np.unique(mesh.f2t[:, _singular_edges(mesh)])
    return elements[elements >= 0]


def _resolved(fabric: Fabric, basis: MeanBasis) -> ndarray:
    """True for families along which triangles are long, shape (2, n_elements)."""
    mesh, area = basis.mesh, basis.dx.sum(axis=1)
    start, end = mesh.p[:, mesh.facets].swapaxes(0, 1)
    middle, length = 0.5 * (start + end), np.hypot(*(end - start))
    along = (end - start) / length
    resolved = np.zeros((2, basis.nelems), dtype=bool)
    for side in mesh.f2t:
        edge = np.flatnonzero((side >= 0) & (length**2 > 2 * _LONG * area[side]))
        cell = side[edge]
        numbers = element_numbers(basis)[cell, :1]
        for family, A in enumerate(fabric.directions(middle[:, edge, None], numbers)):
            sine = A[0, :, 0] * along[1, edge] - A[1, :, 0] * along[0, edge]
            resolved[family, cell[np.abs(sine) < _FOLLOWS]] = True
    return resolved


def refuse_stiffness(name: str, value: float | str, also: str = "") -> None:
    """Validate a stiffness, or "auto" where permitted."""
    if also and isinstance(value, str) and value == "auto":
        return
    if not isinstance(value, Real) or not (np.isfinite(value) and value >= 0):
        given = shortened(value)
        raise ValueError(f"{name} must be a finite number >= 0{also}, got {given}")


def hourglass_terms(
    stabilisation: float | str, basis: CellBasis, fabric: Fabric
) -> list[Term]:
    """Hourglass terms for C_s, a number or ``auto``; empty if C_s is zero.

    In space these are the hourglass term and `OutOfPlane`.
    """
    if stabilisation == 0:
        return []
    C_s = None if stabilisation == "auto" else float(stabilisation)
    corners = hourglass_basis(basis)
    automatic = _automatic(basis, fabric) if C_s is None else None
    forms_of_shear = forms.hourglass(fabric, C_s)
    terms: list[Term] = [stabilising_term(forms_of_shear, corners, automatic)]
    if components(basis) == 3:
        out_of_plane = OutOfPlane(
            "out_of_plane",
            forms.out_of_plane(),
            corners,
            C_s=_most_against_twist(np.inf if C_s is None else C_s, fabric, corners),
            role="stabilisation",
            parameters=_automatic(basis, fabric, across=True) if C_s is None else None,
        )
        terms.append(out_of_plane)
    return terms


def _most_against_twist(C_s: float, fabric: Fabric, basis: HourglassBasis) -> ndarray:
    """Upper limit of the out-of-plane C_s, shape (n_elements, 1).

    If fibres resist bending, the twist stiffness of elements is limited to a fraction
    of the bending stiffness.  A bending stiffness D has the energy ½ D κ² per area; C_s
    has ½ C_s A/6 κ² for the twist κ of a square of area A.
    """
    least = np.minimum(*fabric.bending_at_rest)
    D = np.broadcast_to(least, basis.dx[:, 0].shape)[:, None]
    most = _TWIST_OVER_BENDING * 6 * D / basis.dx.sum(axis=1, keepdims=True)
    return np.where(D > 0, np.minimum(C_s, most), C_s)


def hourglass_basis(basis: CellBasis) -> HourglassBasis:
    """`HourglassBasis` of the same displacement."""
    d = components(basis)
    return HourglassBasis(basis.mesh, d, mapping=basis.mapping, dofs=basis.dofs)


def _automatic(
    basis: CellBasis, fabric: Fabric, across: bool = False
) -> HeldStabilisation:
    """C_s of each element; the grip is omitted out of the plane.

    Tension is included only on a `MeanBasis`: at a single point it does not represent
    the fabric.
    """
    of_means = isinstance(basis, MeanBasis)
    means: Any = basis if of_means else _mean_basis(basis, CENTRE)
    return HeldStabilisation(fabric, means, by_tension=of_means, by_grip=not across)


def _mean_basis(basis: CellBasis, rule: tuple[ndarray, ndarray]) -> MeanBasis:
    """`MeanBasis` of the same displacement, with the points and weights of a rule."""
    displacement = basis.mesh, basis.elem, basis.mapping
    return MeanBasis(*displacement, dofs=basis.dofs, quadrature=rule)


def _stiffness_title(C_s: float | str) -> str:
    """Stabilisation stiffness in the titles of pictures, with its unit."""
    return f"C_s = {C_s}" if C_s == "auto" else f"C_s = {C_s:g} N/mm"


def stabilising_term(
    forms: forms.Forms,
    basis: CellBasis | JumpBasis,
    parameters: TermParameters | None = None,
) -> FormTerm:
    """Stabilisation term."""
    return FormTerm(
        "stabilisation",
        forms,
        basis,
        role="stabilisation",
        parameters=parameters,
    )


@dataclass(frozen=True)
class Full(declared.Full, Quadrilaterals):
    """2×2 points, no stabilisation: locks unless the mesh follows the fibres."""

    name: ClassVar[str] = "full"
    title: ClassVar[str] = "2×2 points"
    rule: ClassVar[tuple[ndarray, ndarray]] = GAUSS

    def reference(self, mesh: Mesh) -> "OnePoint | Macro":
        """One point with the automatic stabilisation; see `OnePoint.reference`."""
        return OnePoint().reference(mesh)

    def log_range(self, mesh: Mesh) -> float:
        """Zero: there is no numerical stiffness."""
        return 0.0


#: Calibrated ``log_range`` of each formulation: `python -m studies interval --case
#: "chosen: *"`.
OF_ONE_POINT, OF_MACRO, OF_QUADRATIC = 1.6, 0.85, 0.7

# Increase of ``log_range`` of quadratic triangles, if those with an edge on a singular
# fibre are as high as this edge is long: they then do not resolve the layer that the
# fibre stretches.
_OF_UNRESOLVED_LAYER = 0.6

# Increase of ``log_range`` of quadratic triangles beside a border between subdomains,
# where they are too stiff rather than too soft.  Chosen by `python -m studies
# singular_fibres --case "choosing *"`.
_OF_BORDERS = 1.3

#: Range of the logarithm of E_d where macro-elements are compared with one point, their
#: limit for a large E_d.  At least 94 % of 70 bias extensions are inside.
OF_DEVIATION_BELOW_ONE_POINT = 0.7

# Increase of ``log_range`` for a stabilisation stiffness that is given as a number.
_OF_NUMBER = 1.0

# Calibrated deviations of quadratic triangles, on meshes along the singular fibres and
# on others.
_ALONG_SINGULAR, _ACROSS_SINGULAR = 400.0, 70.0


#: Stabilisations of one point.
Kind: TypeAlias = declared.Kind


@dataclass(frozen=True)
class OnePoint(declared.OnePoint, Quadrilaterals):
    """One integration point, with the non-constant shear angle stabilised.

    Parameters
    ----------
    stabilisation
        Stabilisation stiffness C_s in N/mm (Hamila & Boisse 2013, §3.2), or ``auto``:
        from the shear stiffness and the angle between the fibres of each element
        (`stabilisation_stiffness`, without tension).
    kind
        ``energy``: path-independent, with an exact tangent.  ``rate``: the accumulated
        rates of the paper, internal variables updated once per step.  For comparison,
        ``continuity``: penalty on jumps of the shear angle between elements;
        ``isotropic``: penalty on hourglass modes in all directions.

    Raises
    ------
    ValueError
        If the stabilisation is negative or not finite, if ``auto`` is used with a kind
        other than ``energy``, or if the kind is unknown.
    """

    name: ClassVar[str] = "one-point"
    rule: ClassVar[tuple[ndarray, ndarray]] = CENTRE

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise ValueError(
                f"kind must be one of {', '.join(get_args(Kind))}, got {self.kind!r}"
            )
        refuse_stiffness("stabilisation", self.stabilisation, " or 'auto'")
        if self.stabilisation == "auto" and self.kind != "energy":
            raise ValueError(
                f"stabilisation='auto' requires kind='energy', not {self.kind!r}: "
                "specify a number"
            )

    @property
    def title(self) -> str:
        """Name in pictures."""
        kind = "" if self.kind == "energy" else f", {self.kind}"
        return f"one point, {_stiffness_title(self.stabilisation)}{kind}"

    def reference(self, mesh: Mesh) -> "OnePoint | Macro":
        """Macro-elements on split triangles, else itself with stabilisation.

        One point in each part of a triangle is the limit of macro-elements for a large
        stiffness of deviations: it locks, which no derivative with respect to the
        stabilisation reveals.
        """
        if was_split(mesh) and any(len(cell) == 3 for cell in mesh.cells):
            return Macro()
        return OnePoint() if self.stabilisation == 0 else self

    def log_range(self, mesh: Mesh) -> float:
        """Calibrated; larger if the stabilisation is a number."""
        return OF_ONE_POINT + _OF_NUMBER * (self.stabilisation != "auto")

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """Stabilisation terms; empty if C_s is zero or there are no interior edges."""
        if self.kind == "energy":
            return hourglass_terms(self.stabilisation, basis, fabric)
        if components(basis) == 3 and self.kind != "isotropic":
            raise ValueError(
                f"stabilisation of kind {self.kind} requires a ply in the plane: use "
                "energy or isotropic in space"
            )
        if (C_s := float(self.stabilisation)) == 0:
            return []
        if self.kind == "continuity":
            if basis.mesh.f2t[1].max() < 0:
                return []
            edges = JumpBasis(basis.mesh, mapping=basis.mapping, dofs=basis.dofs)
            return [stabilising_term(forms.shear_continuity(fabric, C_s), edges)]
        corners = hourglass_basis(basis)
        if self.kind == "isotropic":
            return [stabilising_term(forms.isotropic_hourglass(C_s), corners)]
        moment = AccumulatedMoment(fabric, C_s, corners)
        rate = forms.hourglass_rate(fabric, C_s)
        return [stabilising_term(rate, corners, parameters=moment)]


@dataclass(frozen=True)
class Macro(declared.Macro, Quadrilaterals):
    """Macro-elements: elements split into parts with one point each.

    The full stiffness of the fibres of a macro-element (`split`) acts on the mean
    stretch only (`mean_tension`); each of the parts is stabilised as in `OnePoint`.  No
    parameter needs tuning.

    Parameters
    ----------
    stabilisation
        See `OnePoint`; the automatic value also increases with the tension.
    deviation
        Stiffness that resists deviations from the mean stretch, as a multiple of shear
        stiffness and tension (`deviation_stiffness`), for triangles and for
        quadrilaterals.  Calibrated with bias-extension tests at 30°, 45° and 60°:
        `python -m studies angles --part choosing`.

    Raises
    ------
    ValueError
        If a stiffness is negative or not finite.
    """

    name: ClassVar[str] = "macro"
    rule: ClassVar[tuple[ndarray, ndarray]] = CENTRE

    def __post_init__(self) -> None:
        refuse_stiffness("stabilisation", self.stabilisation, " or 'auto'")
        if np.shape(np.asarray(self.deviation, dtype=object)) != (2,):
            raise ValueError(
                "deviation must be a pair (triangles, quadrilaterals), got "
                f"{self.deviation}"
            )
        for deviation in self.deviation:
            refuse_stiffness("deviation", deviation)

    @property
    def title(self) -> str:
        """Name in pictures."""
        C_s, default = self.stabilisation, self.deviation == Macro.deviation
        return (
            "macro-elements"
            + ("" if C_s == "auto" else f", {_stiffness_title(C_s)}")
            + ("" if default else ", {:g} and {:g}".format(*self.deviation))
        )

    def reference(self, mesh: Mesh) -> "Macro":
        """The formulation itself, or the default if a stiffness is zero."""
        return self if self.stabilisation != 0 and all(self.deviation) else Macro()

    def log_range(self, mesh: Mesh) -> float:
        """Calibrated; larger for a stabilisation or deviations other than default."""
        off = np.abs(np.log(np.divide(self.deviation, Macro.deviation))).max()
        return float(OF_MACRO + _OF_NUMBER * (self.stabilisation != "auto") + off)

    def working_mesh(self, mesh: Mesh) -> Mesh:
        """The split mesh; the mesh itself if it was already split."""
        if was_split(mesh):
            return mesh
        _refuse_changed_after_split(mesh)
        check_mesh(mesh)
        return split(mesh)

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """Tension evaluated at the mean stretch of each macro-element."""
        mesh: Any = basis.mesh
        d = components(basis)
        macro = MacroBasis(mesh, d, mapping=basis.mapping, dofs=basis.dofs)
        of_triangles, of_quadrilaterals = self.deviation
        four = (macro.parts >= 0).sum(axis=1) == 4
        deviation = np.where(four, of_quadrilaterals, of_triangles)
        return mean_tension_term(fabric, deviation[:, None], macro, mesh.parent)

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """Hourglass terms; empty if C_s is zero."""
        return hourglass_terms(self.stabilisation, basis, fabric)


# Integration rules of quadratic triangles by number of points.
_RULES = {3: THREE, 6: SIX}


@dataclass(frozen=True)
class Quadratic(declared.Quadratic, Pointwise):
    """Quadratic triangles without stabilisation.

    The element is `skfem.ElementTriP2` on triangles; quadrilaterals are cut into
    triangles (`cut`).  Nodes are at vertices and edge midpoints.  Strains and folding
    are checked at six points, exact to degree 4.

    Parameters
    ----------
    deviation
        If given, the full stiffness of the fibres acts on the mean stretch of a
        triangle only, and this multiple of shear stiffness and tension
        (`deviation_stiffness`) acts on deviations from it.
    points
        Number of integration points of a triangle: 3, exact to degree 2, or 6, exact to
        degree 4.  Strains are quadratic functions of position, their energy is of
        degree 4.

    Raises
    ------
    ValueError
        If the deviation is negative or not finite, or the number of points is not 3 or
        6.
    """

    name: ClassVar[str] = "quadratic"
    fine_points: ClassVar[ndarray] = SIX[0]

    def __post_init__(self) -> None:
        if self.deviation is not None:
            refuse_stiffness("deviation", self.deviation)
        if self.points not in _RULES:
            raise ValueError(
                "the number of points of quadratic triangles must be 3 or 6, got "
                f"{self.points}"
            )

    @property
    def title(self) -> str:
        """Name in pictures."""
        C_d = self.deviation
        mean = "" if C_d is None else f", mean, {C_d:g}"
        return f"quadratic triangles{mean}{', 6 points' * (self.points == 6)}"

    def reference(self, mesh: Mesh) -> "Quadratic":
        """The formulation itself, or with the calibrated deviation if it has none."""
        return self if self.deviation else replace(self, deviation=_calibrated(mesh))

    def log_range(self, mesh: Mesh) -> float:
        """Calibrated; larger for unresolved layers, borders and other deviations."""
        assert self.deviation is not None
        off = abs(float(np.log(self.deviation / _calibrated(mesh))))
        off += _OF_UNRESOLVED_LAYER * _height_of_layer(mesh)
        return OF_QUADRATIC + _OF_BORDERS * _has_borders(mesh) + off

    def working_mesh(self, mesh: Mesh) -> Mesh:
        """Triangles, unchanged or cut from quadrilaterals, before a split."""
        _refuse_changed_after_split(mesh)
        if getattr(mesh, "elem", None) is not ElementQuad1:
            return mesh
        check_mesh(mesh)
        quads: Any = mesh
        return cut(quads)

    def basis(self, mesh: Mesh, dimension: int = 2) -> CellBasis:
        """Basis of the displacement."""
        check_mesh(mesh)
        return triangle_basis(mesh, dimension, _RULES[self.points])

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """Tension at each point, or evaluated at the mean stretch."""
        if self.deviation is None:
            return super().tension_term(basis, fabric)
        means = MeanBasis.at_points_of(basis)
        return mean_tension_term(fabric, self.deviation, means, np.arange(basis.nelems))


def _height_of_layer(mesh: Mesh) -> float:
    """Median aspect (height over length) of triangles on singular fibres, at most 1.

    The length is the length of the edge on the fibre; 0 if there is no such triangle.
    """
    edges = _singular_edges(mesh)
    if not edges.size:
        return 0.0
    a, b = mesh.p[:, mesh.facets[:, edges]].swapaxes(0, 1)
    square = ((b - a) ** 2).sum(axis=0)
    sides = mesh.f2t[:, edges]
    x, y = mesh.p[:, mesh.t]
    double = np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    heights = (double[sides] / square)[sides >= 0]
    return min(1.0, float(np.median(heights)))


def _has_borders(mesh: Mesh) -> bool:
    """True if subdomains border on others."""
    sides = mesh.f2t[:, mesh.f2t[1] >= 0]
    subdomains = (mesh.subdomains or {}).values()
    return any((np.isin(sides, own).sum(axis=0) == 1).any() for own in subdomains)


def _calibrated(mesh: Mesh) -> float:
    """Calibrated deviation of quadratic triangles on a mesh."""
    along = SINGULAR in (mesh.boundaries or {})
    return _ALONG_SINGULAR if along else _ACROSS_SINGULAR


def _refuse_changed_after_split(mesh: Mesh) -> None:
    if isinstance(mesh, SplitMesh) and not was_split(mesh):
        raise MeshError(
            "the mesh was refined, restricted or renumbered after it was split: "
            "do this before splitting, or pass its elements as a new MeshQuad"
        )


#: Default formulation, for meshes that singular fibres may cross.
DEFAULT = Macro()

#: Formulation where edges of the mesh lie on all singular fibres, chosen by `python -m
#: studies singular_fibres --case "chosen *"`.  The deviation also keeps slack fibres
#: from moving freely.
ON_FIBRES = Quadratic(400.0, points=6)

#: Formulation where no fibre is singular.
SMOOTH = Quadratic(80.0)
