"""Contact at the nodes, instead of the contact points of macro-elements."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from scipy.sparse import identity

from skfem_textile.mesh import recovery


@contextmanager
def contact_at_nodes() -> Iterator[None]:
    """The contact points of plies made in this context are the nodes."""
    before: Any = recovery.contact_points
    at_nodes: Any = lambda mesh, mirrors: identity(mesh.nvertices, format="csr")  # noqa: E731
    recovery.contact_points = at_nodes
    try:
        yield
    finally:
        recovery.contact_points = before
