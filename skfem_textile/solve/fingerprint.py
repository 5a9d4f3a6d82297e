"""Identity of a run: what was given, and values of laws, conditions and forces."""

import re
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric import Law, TwoLaws
from ..ply import Ply
from .conditions import Constraints

# Load factors at which loads and further terms are compared, at no regular distances.
_PROBED = (
    *(0.0, 0.0313, 0.1303, 0.2541, 0.3719, 0.5, 0.6237),
    *(0.7177, 0.8119, 0.9091, 0.9707, 1.0),
)

# Fibre strain and shear angle (radians) up to which laws are compared.
_STRAIN, _ANGLE = 0.1, np.radians(80.0)


def settings(ply: Ply, constraints: Constraints) -> dict[str, Any]:
    """Formulation and laws by their ``repr``, and names of conditions."""
    law = ply.fabric.tensions
    warp, weft = law.laws if isinstance(law, TwoLaws) else (law, law)
    given = {
        "formulation": ply.formulation,
        "warp law": warp,
        "weft law": weft,
        "shear law": ply.fabric.shear_law,
    }
    # On one line, without the place in memory.
    said = {k: re.sub(r" at 0x[0-9a-fA-F]+", "", repr(x)) for k, x in given.items()}
    texts = {name: " ".join(text.split()) for name, text in said.items()}
    return texts | {"conditions": list(constraints.nodes)}


def arrays(ply: Ply, constraints: Constraints, steps: int) -> dict[str, ndarray]:
    """Mesh, fibre directions, laws, conditions, and the forces of each term.

    Conditions are evaluated at the requested load factors and in between; forces at a
    displacement that shears and stretches every element, with the parameters at rest.
    """
    turn, surfaces = constraints.turn, constraints.surfaces
    fabric = ply.fabric.at()
    warp, weft, shear = fabric.laws
    found = {
        "nodes": ply.mesh.p,
        "cells": ply.mesh.t,
        "fibre directions": np.concatenate([A.ravel() for A in ply.directions()]),
        "values of the warp law": _values(warp, _STRAIN),
        "values of the weft law": _values(weft, _STRAIN),
    }
    if not isinstance(fabric.tensions, TwoLaws):
        beside = [fabric.tensions.of_family(i, (_STRAIN, _STRAIN)) for i in range(2)]
        values = np.concatenate([_values(law, _STRAIN) for law in beside])
        found["values of the tensions beside a stretched family"] = values
    found["values of the shear law"] = _values(shear, _ANGLE)
    found |= {f"nodes of {name!r}": nodes for name, nodes in constraints.nodes.items()}
    load_factors = np.linspace(0.0, 1.0, 2 * steps + 1)
    found |= {
        "fixed unknowns": constraints.fixed,
        "fixed directions": np.empty(0) if turn is None else turn.data,
        "fixed values": np.array([constraints.fixed_values(t) for t in load_factors]),
        "surfaces": surfaces.levels(1.0) if surfaces else np.empty(0),
    }
    probe = 0.1 * ply.element_size * np.sin(np.arange(ply.basis.N))
    for t in _PROBED if ply.follows_load_factor else (1.0,):
        forces = ply.residuals(probe, t)
        found |= {f"{name} forces at {t}": f for name, f in forces.items()}
    return found


def _values(law: Law, most: float) -> ndarray:
    """Values of a law, one after the other, as it may have parameters by element."""
    with np.errstate(all="ignore"):
        values = [law.value(np.full(1, x)) for x in np.linspace(-most, most, 41)]
    return np.concatenate([np.ravel(value) for value in values])
