"""Small sound meshes, with names of edges, cells and nodes."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.random import Generator

Cell = tuple[int, ...]

#: Names of groups.
NAMES = ("bottom", "two sides", "Ä", "left:1", "ply", "half", "corner", "UPPER", "x_1")


@dataclass
class SoundMesh:
    """A mesh: positions, shape (n, 2), cells as their nodes, and named groups."""

    points: np.ndarray
    cells: list[Cell]
    edges: dict[str, list[tuple[int, int]]] = field(default_factory=dict)
    regions: dict[str, list[int]] = field(default_factory=dict)
    nodes: dict[str, list[int]] = field(default_factory=dict)

    @property
    def kinds(self) -> list[int]:
        """Numbers of corners of the cells, ascending, each once."""
        return sorted({len(cell) for cell in self.cells})


def sound_mesh(rng: Generator, one_kind: bool = False) -> SoundMesh:
    """A distorted grid of at most 4 by 6 quadrilaterals, some of them cut."""
    n, m = rng.integers(1, 5), rng.integers(1, 7)
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(m + 1.0), indexing="ij")
    p = np.stack([x.ravel(), y.ravel()], axis=1)
    p += rng.uniform(-0.2, 0.2, p.shape) * rng.integers(0, 2)
    angle, size = rng.uniform(0, 6) * rng.integers(0, 2), 10 ** rng.uniform(-3, 3)
    c, s = np.cos(angle), np.sin(angle)
    p = (p @ np.array([[c, s], [-s, c]]) + rng.integers(-5, 5, 2)) * size
    number = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    quads = [
        (number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1])
        for i in range(n)
        for j in range(m)
    ]
    share = rng.choice([0.0, 1.0] if one_kind else [0.0, 0.0, 0.5, 1.0])
    cells: list[Cell] = []
    for a, b, c, d in quads:
        cut = rng.random() < share
        cells += [(a, b, c), (a, c, d)] if cut else [(a, b, c, d)]
    turned = rng.integers(0, 2)
    cells = [_rolled(cell[::-1] if turned else cell, rng) for cell in cells]
    order = rng.permutation(len(p)) if rng.integers(0, 2) else np.arange(len(p))
    cells = [tuple(int(order[node]) for node in cell) for cell in cells]
    mesh = SoundMesh(p[np.argsort(order)], cells)
    sides = [order[number[:, 0]], order[number[:, -1]], order[number[0]]]
    _name(mesh, rng, [[int(i) for i in side] for side in sides])
    return mesh


def _rolled(cell: Cell, rng: Generator) -> Cell:
    by = int(rng.integers(0, len(cell)))
    return cell[by:] + cell[:by]


def _name(mesh: SoundMesh, rng: Generator, sides: list[list[int]]) -> None:
    """Give names to sides, to the edges of a cell, to cells and to nodes."""
    names = [str(name) for name in rng.permutation(NAMES)]
    for side in sides[: rng.integers(0, 4)]:
        mesh.edges[names.pop()] = list(pairwise(side))
    if rng.integers(0, 2):
        cell = mesh.cells[rng.integers(0, len(mesh.cells))]
        mesh.edges[names.pop()] = list(pairwise(cell))
    for _ in range(rng.integers(0, 3)):
        cells = np.flatnonzero(rng.integers(0, 2, len(mesh.cells)))
        mesh.regions[names.pop()] = cells.tolist() or [0]
    for _ in range(rng.integers(0, 2)):
        number = int(rng.integers(1, 3))
        nodes = rng.choice(len(mesh.points), number, replace=False)
        mesh.nodes[names.pop()] = nodes.tolist()
