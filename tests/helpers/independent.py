"""Independent implementation of all energies from their definitions in plain numpy
loops.

Nothing here comes from the library; `test_independent` compares the library with it.

A motion is given by the current positions ``x`` of the nodes, shape (2, n_nodes, m): m
motions at once, for which every energy gives m values.  All formulas are analytic, so
that ``x`` may be complex: forces are differences along the imaginary axis.
"""

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy import ndarray

# Derivatives along the imaginary axis


STEP = 1e-30


def imaginary_moves(x):
    """x, shape (2, n_nodes, 1), with one coordinate after the other moved by ih."""
    n = x.size
    return x + 1j * STEP * np.eye(n).reshape(2, -1, n)


def derivative(energies):
    """Forces, (2, n_nodes), from energies at `imaginary_moves`: Im E(x + ih)/h."""
    return energies.imag.reshape(2, -1) / STEP


# Scalar and biaxial laws, and the stiffnesses derived from them


class Law(NamedTuple):
    """A scalar law: its energy, its derivative, and its second derivative at rest."""

    energy: Callable
    value: Callable
    at_rest: float


class Biaxial(Law):
    """A law of both fibre strains: its energy, tensions, and their slope at rest."""


def laws_of_families(cloth, strains):
    """The law of each family, with the strain of the other one fixed."""
    if not isinstance(cloth.tension, Biaxial):
        return cloth.tension
    (e_1, e_2), (_, value, at_rest) = strains, cloth.tension
    warp = Law(None, lambda x: value(x, e_2)[0], at_rest)
    return warp, Law(None, lambda x: value(e_1, x)[1], at_rest)


def interchange(E, c, K, e_0, k):
    """Tensions of a saw-tooth of two yarns: min_w Σ φ(e_α) + ½ K w² + ½ k Σ ε_α².

    e₁ = ε₁ + ½ (η₁ − w)² − c₁ and e₂ = ε₂ + ½ (η₂ + w)² − c₂ with η² = 2 c.  The
    minimiser w is computed for real parts by bisection: there the energy is stationary
    in w.
    """
    eta = [math.sqrt(2 * c_i) for c_i in c]

    def yarn_strains(strains, w):
        shapes = (eta[0] - w) ** 2 / 2 - c[0], (eta[1] + w) ** 2 / 2 - c[1]
        return [eps + shape for eps, shape in zip(strains, shapes, strict=True)]

    def taut(E, e, exp=np.exp):
        return E * (e - e_0 * (1 - exp(-e / e_0)))

    def tension(E, e):
        return np.where(e.real > 0, taut(E, e), 0)

    def yarn_energy(E, e):
        toe = e_0 * e - e_0**2 * (1 - np.exp(-e / e_0))
        return np.where(e.real > 0, E * (e**2 / 2 - toe), 0)

    @np.vectorize
    @cache
    def least(*strains):
        strains, low, high = [float(eps) for eps in strains], -eta[1], eta[0]
        for _ in range(55):
            w = (low + high) / 2
            yarns = zip(E, yarn_strains(strains, w), strict=True)
            T_1, T_2 = (taut(E_i, max(e, 0.0), math.exp) for E_i, e in yarns)
            slope = -T_1 * (eta[0] - w) + T_2 * (eta[1] + w) + K * w
            low, high = (w, high) if slope < 0 else (low, w)
        return w

    def energy(*strains):
        w = least(*map(np.real, strains))
        yarns = map(yarn_energy, E, yarn_strains(strains, w))
        return sum(yarns) + K * w**2 / 2 + k * sum(eps**2 for eps in strains) / 2

    def value(*strains):
        yarns = map(tension, E, yarn_strains(strains, least(*strains)))
        return [T + k * eps for T, eps in zip(yarns, strains, strict=True)]

    return Biaxial(energy, value, k)


def at_rest(law):
    return 0.0 if law is None else law.at_rest


def secant_of(law, gamma):
    """M_s(Γ)/Γ, at least a tenth of its value at rest."""
    if law is None:
        return 0.0
    secant = law.value(gamma) / gamma if abs(gamma) > 1e-6 else law.at_rest
    return max(secant, 0.1 * law.at_rest)


def further_shear(law, gamma):
    """The larger of `secant_of` and the tangent."""
    tangent = 0.0 if law is None else law.value(gamma + 1e-20j).imag / 1e-20
    return max(secant_of(law, gamma), tangent)


def slope_near(law, eps=0.0):
    """Mean slope of a tension law within a percent of strain, or at rest if slack."""
    if law is None:
        return 0.0
    eps = max(eps, 0.0)
    return max((law.value(eps + 0.01) - law.value(eps - 0.01)) / 0.02, 0.0)


# A cloth, its elements and their points


class Cloth(NamedTuple):
    """Nodes (2, n_nodes), nodes of each element, fibres and laws.

    Elements are bilinear quadrilaterals, four nodes in either sense of rotation, or
    straight triangles of six: vertices, then middles of the edges 01, 12, 20.
    ``fibres(element, position)`` gives unit vectors A₁, A₂.  The law is None without
    stiffness; a pair of laws may be a `Biaxial` one.
    """

    X: ndarray
    elements: Sequence[ndarray]
    fibres: Callable
    tension: tuple[Law | None, Law | None] | Biaxial
    shear: Law | None


class Point(NamedTuple):
    """A point of an element: its nodes, ∂N_a/∂X, (n, 2), fibres and area."""

    nodes: ndarray
    dN_dX: ndarray
    A: tuple[ndarray, ndarray]
    area: float


CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
GAUSS = tuple((a / np.sqrt(3), b / np.sqrt(3)) for a, b in CORNERS)
EDGE_MIDDLES = ((0, -1), (1, 0), (0, 1), (-1, 0))  # of the edges 01, 12, 23, 30
THREE = ((1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3))
SIX_NODES = ((0, 0), (1, 0), (0, 1), (1 / 2, 0), (1 / 2, 1 / 2), (0, 1 / 2))


def bilinear(xi, eta):
    """N_a and ∂N_a/∂(ξ, η) on the square [−1, 1]²."""
    N = [(1 + a * xi) * (1 + b * eta) / 4 for a, b in CORNERS]
    dN = [(a * (1 + b * eta) / 4, (1 + a * xi) * b / 4) for a, b in CORNERS]
    return np.array(N), np.array(dN)


def quadratic(s, t):
    """N_a and ∂N_a/∂(s, t) on the triangle (0, 0), (1, 0), (0, 1)."""
    r = 1 - s - t
    N = [r * (2 * r - 1), s * (2 * s - 1), t * (2 * t - 1)]
    N += [4 * r * s, 4 * s * t, 4 * t * r]
    dN = [(1 - 4 * r, 1 - 4 * r), (4 * s - 1, 0), (0, 4 * t - 1)]
    dN += [(4 * (r - s), -4 * s), (4 * t, 4 * s), (-4 * t, 4 * (r - t))]
    return np.array(N), np.array(dN)


def shape(nodes, at):
    return (bilinear if len(nodes) == 4 else quadratic)(*at)


def gradients(x, dN):
    """∂N_a/∂x, shape (n, 2), on an element with nodes at x, shape (2, n)."""
    return dN @ np.linalg.inv(x @ dN)


def polygon(x):
    """Area of a polygon with the corners x, shape (2, n)."""
    following = np.roll(x, -1, axis=1)
    return abs(np.sum(x[0] * following[1] - x[1] * following[0])) / 2


def area(cloth, e):
    nodes = cloth.elements[e]
    return polygon(cloth.X[:, nodes[: 4 if len(nodes) == 4 else 3]])


def point(cloth, e, at, area=0.0):
    nodes = cloth.elements[e]
    N, dN = shape(nodes, at)
    X = cloth.X[:, nodes]
    return Point(nodes, gradients(X, dN), cloth.fibres(e, X @ N), area)


def points_of(cloth, e, rule):
    """Points of an element.

    ``gauss``: 2×2 with their Jacobians; ``centre``: one with the whole area; ``three``:
    of a triangle, with a third of the area each.
    """
    if rule == "centre":
        return [point(cloth, e, (0, 0), area(cloth, e))]
    if rule == "three":
        return [point(cloth, e, at, area(cloth, e) / 3) for at in THREE]
    X = cloth.X[:, cloth.elements[e]]
    jacobians = [abs(np.linalg.det(X @ bilinear(*at)[1])) for at in GAUSS]
    return [point(cloth, e, *p) for p in zip(GAUSS, jacobians, strict=True)]


def points(cloth, rule):
    return [p for e in range(len(cloth.elements)) for p in points_of(cloth, e, rule)]


# Deformation of the fibres


def deformation_gradient(x, p):
    """F = Σ_a x_a ⊗ ∂N_a/∂X, shape (2, 2, m)."""
    return np.einsum("iam,aJ->iJm", x[:, p.nodes], p.dN_dX)


def fibre(F, A):
    return np.einsum("iJm,J->im", F, A)


def strain(F, A):
    """ε = ln|F A|."""
    a = fibre(F, A)
    return np.log(a[0] ** 2 + a[1] ** 2) / 2


def angle(b, c):
    """Angle from b to c in (−π, π): twice the angle whose tangent is sin/(1 + cos)."""
    cos, sin = b[0] * c[0] + b[1] * c[1], b[0] * c[1] - b[1] * c[0]
    return 2 * np.arctan(sin / (np.sqrt(cos**2 + sin**2) + cos))


def shear_angle(F, A):
    """Γ = ∠(A₁, A₂) − ∠(a₁, a₂)."""
    return angle(*A) - angle(fibre(F, A[0]), fibre(F, A[1]))


def smallest_det_F(cloth, x):
    """The smallest det F at the nodes of all elements, for positions (2, n_nodes)."""
    determinants = []
    for nodes in cloth.elements:
        for at in CORNERS if len(nodes) == 4 else SIX_NODES:
            _, dN = shape(nodes, at)
            F = x[:, nodes] @ gradients(cloth.X[:, nodes], dN)
            determinants.append(np.linalg.det(F))
    return min(determinants)


# Energies of tension and shear


def tension(cloth, x, rule):
    """∫ Σ_α ψ(ε_α) dΩ."""
    return sum(
        p.area * of_strains([strain(deformation_gradient(x, p), A) for A in p.A], cloth)
        for p in points(cloth, rule)
    )


def of_strains(strains, cloth):
    """ψ of the strains of warp and weft."""
    if isinstance(cloth.tension, Biaxial):
        return cloth.tension.energy(*strains)
    pairs = zip(cloth.tension, strains, strict=True)
    return sum(law.energy(eps) for law, eps in pairs if law is not None)


def shear(cloth, x, rule):
    """∫ w(Γ) dΩ."""
    return sum(
        p.area * cloth.shear.energy(shear_angle(deformation_gradient(x, p), p.A))
        for p in points(cloth, rule)
    )


def mean_tension(cloth, x, groups, multiples, converged=()):
    """∫ Σ_α ψ(ln λ̄_α) + ½ E_d (λ_α − λ̄_α)² dΩ, λ̄ the mean over a group of points.

    E_d is evaluated at the last converged state.
    """
    last = converged[-1] if converged else cloth.X[..., None]
    stiffnesses, whole = deviation_stiffnesses(cloth, last, groups, multiples), 0.0
    for group, pair in zip(groups, stiffnesses, strict=True):
        A_e, means = sum(p.area for p in group), []
        for i, E_d_i in enumerate(pair):
            stretches = [
                np.exp(strain(deformation_gradient(x, p), p.A[i])) for p in group
            ]
            pairs = list(zip(group, stretches, strict=True))
            mean = sum(p.area * stretch for p, stretch in pairs) / A_e
            means.append(mean)
            whole = whole + sum(
                p.area * E_d_i / 2 * (stretch - mean) ** 2 for p, stretch in pairs
            )
        whole = whole + A_e * of_strains(np.log(means), cloth)
    return whole


def macro_tension(cloth, x, macros, multiples, converged=()):
    """`mean_tension` at the centres of the quadrilaterals of each macro-element.

    ``multiples`` are the values of c for original triangles and quadrilaterals.
    """
    groups = [[points_of(cloth, e, "centre")[0] for e in parts] for parts in macros]
    of_parts = dict(zip((3, 4), multiples, strict=True))
    chosen = [of_parts[len(parts)] for parts in macros]
    return mean_tension(cloth, x, groups, chosen, converged)


def quadratic_mean_tension(cloth, x, c):
    """`mean_tension` at the three points of each triangle."""
    groups = [points_of(cloth, e, "three") for e in range(len(cloth.elements))]
    return mean_tension(cloth, x, groups, [c] * len(groups))


# Resistance of corners that close


def corner_stiffness(cloth):
    """κ: the shear stiffness at rest, or 10⁻⁵ of the mean fibre stiffness if larger."""
    laws = laws_of_families(cloth, (0.0, 0.0))
    return max(at_rest(cloth.shear), 1e-5 * sum(map(at_rest, laws)) / 2)


def corner_energy(J):
    """ln³(0.08/J) below J = 0.08, and below J = 0.02 its parabola there."""
    J1 = 0.02
    log = np.log(0.08 / J1)
    b, d, dd = log**3, -3 * log**2 / J1, (6 * log + 3 * log**2) / J1**2
    parabola = b + d * (J - J1) + dd * (J - J1) ** 2 / 2
    with np.errstate(all="ignore"):  # of the unselected branch
        cubic = np.log(0.08 / J) ** 3
    return np.where(J.real >= 0.08, 0, np.where(J.real < J1, parabola, cubic))


def corners(cloth, x):
    """κ Σ A/n b(det F) over the n nodes of each element; its area is A.

    Corners at which the element is flat or reflex at rest are excluded.
    """
    total = np.zeros(x.shape[-1], dtype=x.dtype)
    for e, nodes in enumerate(cloth.elements):
        points = CORNERS if len(nodes) == 4 else SIX_NODES
        at_rest = [
            np.linalg.det(cloth.X[:, nodes] @ shape(nodes, at)[1]) for at in points
        ]
        for at, J in zip(points, at_rest, strict=True):
            if J * np.sign(sum(at_rest)) > 1e-9 * np.abs(at_rest).max():
                F = deformation_gradient(x, point(cloth, e, at))
                det = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
                total = total + area(cloth, e) / len(nodes) * corner_energy(det)
    return corner_stiffness(cloth) * total


# Energies of stabilisation, and the paper's rates


def hourglass(cloth, x, C_s):
    """½ C_s Σ_k A/4 (Γ(ξ_k) − Γ(0))²; C_s is a number or one per element.

    Both angles are between the fibres at ξ_k, under F(ξ_k) and F(0).
    """
    C_s, energy = np.broadcast_to(C_s, len(cloth.elements)), 0.0
    for e in range(len(cloth.elements)):
        F_0 = deformation_gradient(x, point(cloth, e, (0, 0)))
        for at in GAUSS:
            p = point(cloth, e, at)
            F_k = deformation_gradient(x, p)
            difference = shear_angle(F_k, p.A) - shear_angle(F_0, p.A)
            energy = energy + C_s[e] / 2 * area(cloth, e) / 4 * difference**2
    return energy


def automatic_hourglass(cloth, x, macros, converged):
    """`hourglass` with C_s of the last converged state."""
    last = converged[-1] if converged else cloth.X[..., None]
    return hourglass(cloth, x, automatic_stiffness(cloth, last, macros))


def isotropic(cloth, x, kappa):
    """½ κ Σ_k A/4 ‖∇u(ξ_k) − ∇u(0)‖²."""
    energy = 0.0
    for e in range(len(cloth.elements)):
        F_0 = deformation_gradient(x, point(cloth, e, (0, 0)))
        for at in GAUSS:
            dF = deformation_gradient(x, point(cloth, e, at)) - F_0
            energy = energy + kappa / 2 * area(cloth, e) / 4 * (dF**2).sum(axis=(0, 1))
    return energy


def continuity(cloth, x, C_j):
    """½ C_j Σ_edges (A⁺ + A⁻)/4 [[Γ]]² at the middles of the interior edges."""
    sides = {}
    for e, nodes in enumerate(cloth.elements):
        for i, at in enumerate(EDGE_MIDDLES):
            edge = frozenset((nodes[i], nodes[(i + 1) % 4]))
            sides.setdefault(edge, []).append((e, at))
    energy = 0.0
    for side in sides.values():
        if len(side) == 1:
            continue  # an edge of the ply
        points = [point(cloth, e, at) for e, at in side]
        one, other = (shear_angle(deformation_gradient(x, p), p.A) for p in points)
        weight = sum(area(cloth, e) for e, _ in side) / 4
        energy = energy + C_j / 2 * weight * (one - other) ** 2
    return energy


# The paper's rates, which have work and forces, but no energy


def rate_vectors(cloth, x, e):
    """A/4 and, for each of the 2×2 points, (f·B_HGL)_ai: f·(B_HGL v) is its sum with v.

    Everything refers to the current configuration x, shape (2, n_nodes).  With unit
    vectors f₁, f₂ along the fibres, f² normal to f₁ and f¹ to f₂, Γ̇ = f²·L f₁ + f¹·L
    f₂; where the weft lies anticlockwise of the warp f² is f₁ rotated by 90° and f¹ is
    f₂ rotated by −90°, so that both point between the fibres.
    """
    nodes = cloth.elements[e]
    current = x[:, nodes]
    vectors = []
    for at in GAUSS:
        p = point(cloth, e, at)
        a_1, a_2 = (fibre(deformation_gradient(x[..., None], p), A)[:, 0] for A in p.A)
        f_1, f_2 = a_1 / np.linalg.norm(a_1), a_2 / np.linalg.norm(a_2)
        normal_1, normal_2 = np.array([-f_1[1], f_1[0]]), np.array([f_2[1], -f_2[0]])
        f = np.outer(normal_1, f_1) + np.outer(normal_2, f_2)  # Γ̇ = Σ_ij f_ij L_ij
        B = gradients(current, bilinear(*at)[1]) - gradients(current, bilinear(0, 0)[1])
        vectors.append(B @ f.T)  # L_ij = Σ_a v_ai B_aj
    return polygon(current) / 4, vectors


def rate_step(cloth, x, last, moments, C_s):
    """Moments M̃_k after a step from ``last`` to ``x``, its work, and the forces at x.

    M̃_k grows by C_s f_k·(B_HGL,k Δu); the forces are Σ_k A/4 B_HGL,kᵀ f_k M̃_k, and
    the work uses the mean of the old and the new M̃_k on the increment.
    """
    new, work, force = np.zeros_like(moments), 0.0, np.zeros_like(x)
    for e, nodes in enumerate(cloth.elements):
        quarter, vectors = rate_vectors(cloth, x, e)
        for k, vector in enumerate(vectors):
            increment = np.sum(vector.T * (x - last)[:, nodes])
            new[e, k] = moments[e, k] + C_s * increment
            work += quarter * (moments[e, k] + new[e, k]) / 2 * increment
            force[:, nodes] += quarter * vector.T * new[e, k]
    return new, work, force


def rate(cloth, x, C_s, converged):
    """Work of all steps over the converged states to x, and the forces at x."""
    last, moments, work = cloth.X, np.zeros((len(cloth.elements), 4)), 0.0
    for state in [*converged, x]:
        current = state[..., 0]
        moments, done, force = rate_step(cloth, current, last, moments, C_s)
        last, work = current, work + done
    return work, force


# Stabilisation stiffnesses, which depend on the last converged state


def share_without_shear(G, E):
    """1 without shear stiffness, 0 if it exceeds about 10⁻¹⁰ E."""
    return np.exp(-G / (1e-14 * E)) if E > 0 else 0.0


class StateOfGroup(NamedTuple):
    """Means over a group of points that determine the stabilisation stiffnesses.

    Secant of shear, the larger of it and the tangent, slope of the tension law and
    tension at the mean stretch of both families, and |cos| of the angle between them.
    """

    secant: float
    further: float
    E: np.ndarray
    T: np.ndarray
    cosine: float


def state_of_group(cloth, x, group):
    """The means over a group of points at a displaced state."""
    whole = sum(p.area for p in group)
    secant = further = cosine = 0.0
    E, stretch = np.zeros(2), np.zeros(2)
    for p in group:
        share, F = p.area / whole, deformation_gradient(x, p)
        gamma = shear_angle(F, p.A)[0]
        strains = [strain(F, A)[0] for A in p.A]
        laws = laws_of_families(cloth, strains)
        a_1, a_2 = (F[..., 0] @ A for A in p.A)
        secant += share * secant_of(cloth.shear, gamma)
        further += share * further_shear(cloth.shear, gamma)
        cosine += share * abs(a_1 @ a_2) / np.sqrt((a_1 @ a_1) * (a_2 @ a_2))
        E += share * np.array(list(map(slope_near, laws, strains)))
        stretch += share * np.exp(strains)
    laws = laws_of_families(cloth, np.log(stretch))
    pairs = zip(laws, np.log(stretch), strict=True)
    T = np.array([0.0 if law is None else law.value(eps) for law, eps in pairs])
    return StateOfGroup(secant, further, E, T, cosine)


def effective_tension(G, E, T):
    """τ = |T|/(1 + 80 √(G/E))."""
    return abs(T) / (1 + 80 * np.sqrt(G / E)) if E > 0 else abs(T)


def deviation_stiffnesses(cloth, x, groups, multiples):
    """E_d of both families of each group of points at a converged state.

    c (G + 0.7 τ) in series with E, ½ E without shear stiffness.  ``multiples`` has the
    c of each group.
    """
    stiffnesses = []
    for group, c in zip(groups, multiples, strict=True):
        state, pair = state_of_group(cloth, x, group), []
        for E, T in zip(state.E, state.T, strict=True):
            tau = effective_tension(state.further, E, T)
            resistance = c * (state.further + 0.7 * tau)
            series = resistance * E / (resistance + E) if resistance + E > 0 else 0.0
            chi = share_without_shear(state.further, E)
            pair.append((1 - chi) * series + chi * E / 2)
        stiffnesses.append(pair)
    return stiffnesses


def automatic_stiffness(cloth, x, macros):
    """C_s of each element at a converged state.

    (4 G + 3.2 τ)/(1 − |cos ω|)^1.5, and without shear stiffness 10⁻⁴ E; G, E and τ are
    means of both families, at the centre of an element or over the parts of a macro-
    element.  Single elements have τ = 0.
    """
    C_s = np.zeros(len(cloth.elements))
    for parts in macros or [[e] for e in range(len(cloth.elements))]:
        centres = [points_of(cloth, e, "centre")[0] for e in parts]
        state = state_of_group(cloth, x, centres)
        G, E = state.secant, state.E.mean()
        tau = effective_tension(G, E, abs(state.T).mean()) if macros else 0.0
        chi = share_without_shear(G, E)
        resistance = (4 * G + 3.2 * tau) / max(1 - state.cosine, 0.01) ** 1.5
        C_s[parts] = (1 - chi) * resistance + chi * 1e-4 * E
    return C_s
