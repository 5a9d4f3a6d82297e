"""Derivatives along the imaginary axis."""

import numpy as np

STEP = 1e-30


def imaginary_moves(x):
    """x, shape (2, n_nodes, 1), with one coordinate after the other moved by ih."""
    n = x.size
    return x + 1j * STEP * np.eye(n).reshape(2, -1, n)


def derivative(energies):
    """Forces, (2, n_nodes), from energies at `imaginary_moves`: Im E(x + ih)/h."""
    return energies.imag.reshape(2, -1) / STEP
