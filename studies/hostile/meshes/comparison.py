"""Compares a mesh that the library read with what a plain reader read."""

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import Mesh

from skfem_textile.mesh.selection import named_nodes
from skfem_textile.mesh.splitting import was_split

from ..readers.mesh_content import MeshContent

# Thickness up to which a mesh is plane, as a share of its size.
_PLANE = 1e-9


def difference(mesh: Mesh, content: MeshContent) -> str:
    """The first difference; empty where there is none."""
    x = np.array(content.points, dtype=float)
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
    own = [_normalised(cell) for block in cells for cell in block.T.tolist()]
    if Counter(own) != Counter(map(_normalised, content.cells)):
        return "cells differ"
    edges, nodes = _edges_and_nodes(content)
    for what, ours, expected in (
        ("boundaries", _boundaries(mesh), _pieces(mesh, x[:, :2], edges)),
        ("subdomains", _regions(mesh, own), _cells(content)),
        ("named nodes", {k: v.tolist() for k, v in named_nodes(mesh).items()}, nodes),
    ):
        if _filled(ours) != _filled(expected):
            return f"{what} differ: {_filled(ours)} {_filled(expected)}"
    return ""


def _filled(named: dict[str, Any]) -> dict[str, list]:
    """Names of groups that are not empty, with their members in order."""
    return {name: sorted(members) for name, members in named.items() if len(members)}


def _normalised(cell: Iterable[int]) -> tuple[int, ...]:
    """The nodes of a cell, the same from any first corner and in either direction."""
    walk = tuple(cell)
    ways = [walk[i:] + walk[:i] for i in range(len(walk))]
    return min(ways + [way[::-1] for way in ways])


def _edges_and_nodes(content: MeshContent) -> tuple[dict[str, set], dict[str, set]]:
    """Named edges and nodes, those of sets of nodes included."""
    edges = {name: set(members) for name, members in content.edges.items()}
    nodes = {name: set(members) for name, members in content.nodes.items()}
    outer = content.outer_edges()
    for name, members in content.node_sets.items():
        within = {edge for edge in outer if edge <= members}
        edges.setdefault(name, set()).update(within)
        rest = members - {node for edge in within for node in edge}
        nodes.setdefault(name, set()).update(rest)
    return edges, nodes


def _pieces(mesh: Mesh, x: ndarray, edges: dict[str, set]) -> dict[str, list]:
    """Edges by their ends; where the mesh was split, halves by end and middle."""
    pieces: dict[str, list] = {name: [] for name in edges}
    for name, members in edges.items():
        for edge in members:
            ends = sorted(edge)
            halves = [(a, *x[ends].mean(axis=0)) for a in ends]
            pieces[name] += halves if was_split(mesh) else [tuple(ends)]
    return pieces


def _boundaries(mesh: Mesh) -> dict[str, list]:
    """Edges of the mesh in the form of `_pieces`."""
    pieces = {}
    for name, edges in (mesh.boundaries or {}).items():
        pairs = np.sort(mesh.facets[:, np.asarray(edges)], axis=0).T.tolist()
        halves = [(a, *mesh.p[:, b]) for a, b in pairs]
        pieces[name] = halves if was_split(mesh) else [tuple(pair) for pair in pairs]
    return pieces


def _regions(mesh: Mesh, own: list[tuple[int, ...]]) -> dict[str, list]:
    """Cells of the subdomains; () for a cell of which a piece is missing."""
    regions: dict[str, list] = {}
    for name, elements in (mesh.subdomains or {}).items():
        members = np.asarray(elements).tolist()
        if was_split(mesh):
            times = Counter(mesh.parent[members].tolist())
            whole = Counter(mesh.parent.tolist())
            regions[name] = [own[c] if whole[c] == t else () for c, t in times.items()]
        else:
            regions[name] = [own[c] for c in members]
    return regions


def _cells(content: MeshContent) -> dict[str, list]:
    return {
        name: [_normalised(content.cells[i]) for i in members]
        for name, members in content.regions.items()
    }
