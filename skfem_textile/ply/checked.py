"""Terms as a ply takes them: on its basis, and refused where they do not fit."""

from collections.abc import Iterable, Sequence
from copy import copy
from typing import get_args

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from .term import Load, Role, Term, dimension

# What a memory, and a term, must have.
_REMEMBERS = (
    *("parameters", "work", "drift", "held"),
    *("begin", "commit", "restore"),
)
_MEMBERS = "name", "role", "memory", "energy", "residual", "tangent", "couples"


def checked(terms: Iterable[Term | Load], basis: CellBasis) -> tuple[Term, ...]:
    """Terms of a ply, loads among them put on its basis.

    Parameters
    ----------
    terms
        Terms and loads.
    basis
        Basis of the displacement.

    Raises
    ------
    ValueError
        If one is no term, or not of this ply, or has the name of another.
    """
    put = [x.on(basis) if hasattr(x, "on") else x for x in terms]
    names: list[str] = []
    for term in put:
        missing = [m for m in _MEMBERS if not hasattr(term, m)]
        if missing or isinstance(term, type):
            lacks = f"it has no {', '.join(missing)}"
            lacks = "it is a class" if isinstance(term, type) else lacks
            raise ValueError(f"{term!r} is no term: {lacks}")
        if not (isinstance(term.name, str) and term.name):
            raise ValueError(f"a term's name must be some text, got {term.name!r}")
        lacking = [m for m in _REMEMBERS if not hasattr(term.memory, m)]
        if term.memory is not None and lacking:
            raise ValueError(
                f"term {term.name!r}: its memory has no {', '.join(lacking)}"
            )
        if term.role not in get_args(Role):
            raise ValueError(
                f"term {term.name!r}: role must be one of {', '.join(get_args(Role))}, "
                f"got {term.role!r}"
            )
        if term.name in names:
            raise ValueError(f"two terms are named {term.name!r}; name them apart")
        names.append(term.name)
        misfit = getattr(term, "misfit", lambda basis: "")(basis)
        if misfit:
            raise ValueError(f"term {term.name!r}: {misfit}")
    return tuple(put)


def remembering_apart(term: Term | Load) -> Term | Load:
    """The term with a memory of its own, at rest: another ply may have it too."""
    own, memory = copy(term), copy(getattr(term, "memory", None))
    if memory is None or not hasattr(memory, "begin"):
        return term
    object.__setattr__(own, "memory", memory)  # terms may be frozen
    memory.begin()
    return own


def coupled_nodes(term: Term, basis: CellBasis) -> Sequence[ndarray]:
    """Nodes that a term couples beside those of elements: as it says, or does at rest.

    Arrays of shape (n_nodes, n): the nodes of a column all couple.
    """
    if (named := term.couples()) is not None:
        return named
    K = term.tangent(basis.zeros(), 1.0)
    return () if K is None else (np.array(K.nonzero()) // dimension(basis),)
