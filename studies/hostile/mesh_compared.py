"""How a mesh that the library read differs from what a plain reader found."""

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
from skfem import Mesh

from skfem_textile.mesh.named_nodes import named_nodes
from skfem_textile.splitting import was_split

from .plain import Plain

# A mesh whose nodes lie no further apart across it, as a share of its size, is plane.
_PLANE = 1e-9


def difference(mesh: Mesh, plain: Plain) -> str:
    """What differs first; nothing if all is the same."""
    x = np.array(plain.points, dtype=float)
    if not np.isfinite(x).all():
        return "positions that are not finite were read"
    size = np.ptp(x, axis=0)
    if (size[2:] > _PLANE * size[:2].max()).any():
        return "nodes do not lie in a plane"
    cells = mesh.cells if was_split(mesh) else [mesh.t]
    n = len(x)
    if not np.array_equal(mesh.p[:, :n].T, x[:, :2]):
        return "positions differ"
    if not was_split(mesh) and mesh.p.shape[1] != n:
        return "there are other nodes"
    own = [_turned(cell) for block in cells for cell in block.T.tolist()]
    if Counter(own) != Counter(map(_turned, plain.cells)):
        return "cells differ"
    edges, nodes = _edges_and_nodes(plain)
    for what, found, expected in (
        ("boundaries", _boundaries(mesh), _pieces(mesh, plain, edges)),
        ("subdomains", _regions(mesh, own), _cells(plain)),
        ("named nodes", {k: v.tolist() for k, v in named_nodes(mesh).items()}, nodes),
    ):
        if _filled(found) != _filled(expected):
            return f"{what} differ: {_filled(found)} {_filled(expected)}"
    return ""


def _filled(named: dict[str, Any]) -> dict[str, list]:
    """Names of what is not empty, everything in order."""
    return {name: sorted(some) for name, some in named.items() if len(some)}


def _turned(cell: Iterable[int]) -> tuple[int, ...]:
    """The same for the same cell, walked from any corner in either direction."""
    walk = tuple(cell)
    ways = [walk[i:] + walk[:i] for i in range(len(walk))]
    return min(ways + [way[::-1] for way in ways])


def _edges_and_nodes(plain: Plain) -> tuple[dict[str, set], dict[str, set]]:
    """Named edges and nodes, of sets of nodes too."""
    edges = {name: set(some) for name, some in plain.edges.items()}
    nodes = {name: set(some) for name, some in plain.nodes.items()}
    outer = plain.outer_edges()
    for name, members in plain.node_sets.items():
        within = {edge for edge in outer if edge <= members}
        edges.setdefault(name, set()).update(within)
        rest = members - {node for edge in within for node in edge}
        nodes.setdefault(name, set()).update(rest)
    return edges, nodes


def _pieces(mesh: Mesh, plain: Plain, edges: dict[str, set]) -> dict[str, list]:
    """Edges as ends: of a mesh that was split, an end and the middle of each half."""
    x = np.array(plain.points, dtype=float)[:, :2]
    found: dict[str, list] = {}
    for name, some in edges.items():
        for edge in some:
            ends = sorted(edge)
            halves = [(a, *x[ends].mean(axis=0)) for a in ends]
            found.setdefault(name, []).extend(
                halves if was_split(mesh) else [tuple(ends)]
            )
    return found


def _boundaries(mesh: Mesh) -> dict[str, list]:
    """Edges of the mesh as `_pieces` has them."""
    found = {}
    for name, edges in (mesh.boundaries or {}).items():
        pairs = np.sort(mesh.facets[:, np.asarray(edges)], axis=0).T.tolist()
        halves = [(a, *mesh.p[:, b]) for a, b in pairs]
        found[name] = halves if was_split(mesh) else [tuple(pair) for pair in pairs]
    return found


def _regions(mesh: Mesh, own: list[tuple[int, ...]]) -> dict[str, list]:
    """Cells of the subdomains; a cell of which not all pieces are there as None."""
    found: dict[str, list] = {}
    for name, elements in (mesh.subdomains or {}).items():
        members = np.asarray(elements).tolist()
        if was_split(mesh):
            times = Counter(mesh.parent[members].tolist())
            whole = Counter(mesh.parent.tolist())
            found[name] = [own[c] if whole[c] == t else () for c, t in times.items()]
        else:
            found[name] = [own[c] for c in members]
    return found


def _cells(plain: Plain) -> dict[str, list]:
    return {
        name: [_turned(plain.cells[i]) for i in some]
        for name, some in plain.regions.items()
    }
