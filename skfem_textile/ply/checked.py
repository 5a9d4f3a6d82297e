"""Terms as a ply takes them: on its basis, and refused where they do not fit."""

from collections.abc import Iterable, Sequence
from copy import copy
from typing import Any, get_args

import numpy as np
from numpy import ndarray
from skfem import CellBasis
from skfem.assembly.basis import AbstractBasis

from .term import Load, Role, Term, dimension
from .terms import FormTerm, MatrixTerm, VectorTerm

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
        _refuse_other_ply(term, basis)
    return tuple(put)


def remembering_apart(term: Term | Load) -> Term | Load:
    """The term with a memory of its own, at rest: another ply may have it too."""
    own, memory = copy(term), copy(getattr(term, "memory", None))
    if memory is None or not hasattr(memory, "begin"):
        return term
    object.__setattr__(own, "memory", memory)  # terms may be frozen
    memory.begin()
    return own


def _refuse_other_ply(term: Term, basis: CellBasis) -> None:
    """Refuse a term of other unknowns than those of a basis."""
    N = basis.N
    if isinstance(term, FormTerm):
        fits = _same_unknowns(term.basis, basis)
        what = "its basis is not one of the displacement: build it on ply.basis.mesh"
    elif isinstance(term, MatrixTerm):
        fits, what = np.shape(term.matrix) == (N, N), f"its matrix must be {N} × {N}"
    elif isinstance(term, VectorTerm):
        fits = np.shape(term.vector) == (N,) and bool(np.isfinite(term.vector).all())
        what = f"its vector must be {N} finite numbers"
    else:
        return
    if not fits:
        raise ValueError(f"term {term.name!r}: {what}")


def _same_unknowns(other: Any, basis: CellBasis) -> bool:
    """Whether a basis has the unknowns of that of the displacement, node by node."""
    if not isinstance(other, AbstractBasis):
        return False
    same = (other.N, dimension(other)) == (basis.N, dimension(basis))
    mesh, own = other.mesh, basis.mesh
    return same and (
        mesh is own or (np.array_equal(mesh.p, own.p) and np.array_equal(mesh.t, own.t))
    )


def coupled_nodes(term: Term, basis: CellBasis) -> Sequence[ndarray]:
    """Nodes that a term couples beside those of elements: as it says, or does at rest.

    Arrays of shape (n_nodes, n): the nodes of a column all couple.
    """
    if isinstance(term, FormTerm):
        return ()
    if (named := term.couples()) is not None:
        return named
    K = term.tangent(basis.zeros(), 1.0)
    return () if K is None else (np.array(K.nonzero()) // dimension(basis),)
