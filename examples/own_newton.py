"""The forms inside a plain scikit-fem script, with a Newton loop of one's own.

A bias-extension test: a strip of fabric, twice as long as wide, its fibres at
±45° to a distorted mesh, is clamped at the bottom and pulled at the top.  For
inextensible fibres the load is known in closed form.
"""

import numpy as np
from skfem import MeshQuad, asm, condense, solve

from skfem_textile import (
    CENTRE,
    Fabric,
    HourglassBasis,
    hourglass,
    quad_basis,
    shear,
    tension,
)

W, H = 50.0, 100.0  # mm
E, G = 1e4, 0.5  # N/mm

# A regular mesh with its interior nodes moved by up to a quarter of the spacing.
regular = MeshQuad.init_tensor(np.linspace(0, W, 13), np.linspace(0, H, 25))
p, inside = regular.p.copy(), regular.interior_nodes()
p[:, inside] += np.random.default_rng(1).uniform(-1, 1, (2, inside.size))
mesh = MeshQuad(p, regular.t).with_defaults()

fabric = Fabric(tension=E, shear=G, warp=(1, 1), weft=(-1, 1))
centre = quad_basis(mesh, CENTRE)
terms = [
    (tension(fabric), centre),
    (shear(fabric), centre),
    (hourglass(fabric, C_s=10 * G), HourglassBasis(mesh)),
]
top, bottom = centre.get_dofs("top"), centre.get_dofs("bottom")
pulled, fixed = top.nodal["u^2"], np.union1d(top, bottom)
free = centre.complement_dofs(fixed)


def total(part, u):
    """Sum of one part, residual or tangent, over the terms."""
    return sum(asm(getattr(forms, part), basis, u=u) for forms, basis in terms)


def pull(u, elongation):
    """Newton's method from ``u`` to the equilibrium at the given elongation."""
    for _ in range(20):
        f, du = total("residual", u), centre.zeros()
        du[pulled] = elongation - u[pulled]
        if not du.any() and np.abs(f[free]).max() < 1e-8 * np.abs(f).max():
            return u
        u = u + solve(*condense(total("tangent", u), -f, x=du, D=fixed))
    raise RuntimeError("no convergence")


def elongation(gamma):
    """Elongation in mm that shears the middle of the ply by gamma."""
    return (H - W) * (np.sqrt(2) * np.cos(np.pi / 4 - gamma / 2) - 1)


def exact_load(gamma):
    """Load in N on a ply with inextensible fibres."""
    power = W * (2 * H - 3 * W) * G * gamma + W**2 * G * gamma / 2
    return power / ((H - W) * (np.cos(gamma / 2) - np.sin(gamma / 2)))


def main():
    u = centre.zeros()
    for degrees in range(1, 21):
        gamma = np.radians(degrees)
        u = pull(u, elongation(gamma))
    load, exact = total("residual", u)[pulled].sum(), exact_load(gamma)
    print(f"load {load:.3f} N, exact {exact:.3f} N: ratio {load / exact:.3f}")
    assert abs(load / exact - 1) < 0.05


if __name__ == "__main__":
    main()
