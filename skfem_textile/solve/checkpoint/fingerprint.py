"""What tells one problem from another, as given and by what it answers."""

import re
from typing import Any

import numpy as np
from numpy import ndarray

from ...fabric import Fabric, Law, TwoLaws
from ..body import PROBED, Body, Supports

# Fibre strain and shear angle (radians) up to which laws are compared.
_STRAIN, _ANGLE = 0.1, np.radians(80.0)


def settings(ply: Body, constraints: Supports) -> dict[str, Any]:
    """Formulation, laws and names of conditions, as they were given."""
    fabric = ply.fabric
    law = fabric.tensions
    warp, weft = law.laws if isinstance(law, TwoLaws) else (law, law)
    return {
        "formulation": _said(ply.formulation),
        "warp law": _said(warp),
        "weft law": _said(weft),
        "shear law": _said(fabric.shear_law),
        "conditions": list(constraints.nodes),
    }


def arrays(ply: Body, constraints: Supports, steps: int) -> dict[str, ndarray]:
    """Mesh, fibre directions, laws, conditions, and the forces of each term.

    The conditions are asked at the requested load factors and in between; the forces
    are those of a displacement that shears and stretches every element, with the
    parameters at rest.
    """
    load_factors = np.linspace(0.0, 1.0, 2 * steps + 1)
    turn, surfaces = constraints.turn, constraints.surfaces
    probe = 0.1 * ply.element_size * np.sin(np.arange(ply.basis.N))
    fabric = ply.fabric.at()
    warp, weft, shear = fabric.laws
    return {
        "nodes": ply.mesh.p,
        "cells": ply.mesh.t,
        "fibre directions": np.concatenate([A.ravel() for A in ply.directions()]),
        "values of the warp law": _values(warp, _STRAIN),
        "values of the weft law": _values(weft, _STRAIN),
        **_values_beside_stretch(fabric),
        "values of the shear law": _values(shear, _ANGLE),
        **{f"nodes of {name!r}": nodes for name, nodes in constraints.nodes.items()},
        "fixed unknowns": constraints.fixed,
        "fixed directions": np.empty(0) if turn is None else turn.data,
        "fixed values": np.array([constraints.fixed_values(t) for t in load_factors]),
        "surfaces": surfaces.levels(1.0) if surfaces else np.empty(0),
        **{
            f"{name} forces at {t}": forces
            for t in (PROBED if ply.follows_load_factor else (1.0,))
            for name, forces in ply.residuals(probe, t).items()
        },
    }


def _values_beside_stretch(fabric: Fabric) -> dict[str, ndarray]:
    """Values of a tension law of both strains, while the other family is stretched."""
    if isinstance(fabric.tensions, TwoLaws):
        return {}
    laws = [fabric.tensions.of_family(i, (_STRAIN, _STRAIN)) for i in range(2)]
    values = np.concatenate([_values(law, _STRAIN) for law in laws])
    return {"values of the tensions beside a stretched family": values}


def _said(thing: Any) -> str:
    """The repr on one line, without the place in memory."""
    return " ".join(re.sub(r" at 0x[0-9a-fA-F]+", "", repr(thing)).split())


def _values(law: Law, most: float) -> ndarray:
    """Values of a law, one after the other, as it may have parameters by element."""
    with np.errstate(all="ignore"):
        values = [law.value(np.full(1, x)) for x in np.linspace(-most, most, 41)]
    return np.concatenate([np.ravel(value) for value in values])
