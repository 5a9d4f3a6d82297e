"""Defects of meshes by name, and whether they must be refused."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from numpy.random import Generator

from . import sheets
from .sheets import Sheet, fans, jittered, opened, rolled, sheet, shifted, together


class Defect(NamedTuple):
    """A defect.

    Parameters
    ----------
    make
        Gives a sheet with the defect.
    sound
        True if the mesh must be accepted, False if it must be refused, None if either
        is right.
    cells
        "quads" if the defect needs quadrilaterals, "any" if triangles have it too.
    """

    make: Callable[[Generator], Sheet]
    sound: bool | None = False
    cells: str = "any"


def _sheet(rng: Generator) -> Sheet:
    return jittered(sheet(), rng)


def _inner(rng: Generator) -> int:
    """One of the inner nodes of `sheet`."""
    return int(rng.choice([6, 7, 8, 11, 12, 13, 16, 17, 18]))


def _with_coordinate(rng: Generator, value: float) -> Sheet:
    given = _sheet(rng)
    given.p[rng.integers(2), _inner(rng)] = value
    return given


def _thrown(rng: Generator) -> Sheet:
    """An inner node moved beyond the next one."""
    given, node = _sheet(rng), _inner(rng)
    given.p[:, node] += rng.choice([-1, 1]) * np.array([1.6, 0.2])
    return given


def _collapsed(rng: Generator, gap: float = 0.0) -> Sheet:
    """Two nodes of an edge at one place, or this far apart."""
    given, node = _sheet(rng), _inner(rng)
    given.p[:, node + 1] = given.p[:, node] + [gap, 0.0]
    return given


def _flat(rng: Generator) -> Sheet:
    """All nodes on a line."""
    given = _sheet(rng)
    return given._replace(p=np.stack([given.p[0], 0.3 * given.p[0]]))


def _bow_tie(rng: Generator) -> Sheet:
    given, cell = _sheet(rng), int(rng.integers(16))
    given.t[:2, cell] = given.t[[1, 0], cell]
    return given


def _repeated(rng: Generator) -> Sheet:
    given, cells = _sheet(rng), rng.integers(0, 16, rng.integers(1, 4))
    return given._replace(t=np.hstack([given.t, given.t[:, cells]]))


def _third_at_edge(rng: Generator) -> Sheet:
    """A third cell at an inner edge."""
    given = _sheet(rng)
    p = np.hstack([given.p, [[2.2, 2.7], [2.5, 2.4]]])
    return Sheet(p, np.hstack([given.t, [[12], [17], [25], [26]]]))


def _unused(rng: Generator) -> Sheet:
    given = _sheet(rng)
    return given._replace(p=np.hstack([given.p, rng.uniform(-9, 9, (2, 2))]))


def _hanging(rng: Generator) -> Sheet:
    """Fine cells beside coarse ones; they share the corners of the coarse ones."""
    given = together(sheet(2, 2), shifted(sheet(2, 4), 4, 0))
    _positions, first, number = np.unique(
        given.p.round(6), axis=1, return_index=True, return_inverse=True
    )
    return Sheet(given.p[:, first], number.ravel()[given.t])


def _number(rng: Generator, number: int) -> Sheet:
    given = _sheet(rng)
    given.t[rng.integers(4), rng.integers(16)] = number
    return given


def _twice_in_a_cell(rng: Generator) -> Sheet:
    """A quadrilateral with the same node at two corners."""
    given, cell = _sheet(rng), int(rng.integers(16))
    given.t[2, cell] = given.t[int(rng.choice([0, 1])), cell]
    return given


def _reflex(rng: Generator) -> Sheet:
    """A corner of a little more than 180°."""
    return Sheet(np.array([[0, 2, 0.95, 0], [0, 0, 0.98, 2.0]]), np.arange(4)[:, None])


def _seam(by: float) -> Callable[[Generator], Sheet]:
    return lambda rng: together(sheet(), shifted(sheet(), 4 + by, 0))


def _scaled(size: float) -> Callable[[Generator], Sheet]:
    return lambda rng: shifted(_sheet(rng), 0, 0, size)


def _far(by: float) -> Callable[[Generator], Sheet]:
    return lambda rng: shifted(sheet(), by, 0)


def _thin(ratio: float) -> Callable[[Generator], Sheet]:
    return lambda rng: Sheet(_sheet(rng).p * [[1.0], [ratio]], sheet().t)


def _empty(rng: Generator) -> Sheet:
    return Sheet(np.zeros((2, 0)), np.zeros((4, 0), dtype=int))


def _no_cells(rng: Generator) -> Sheet:
    return Sheet(_sheet(rng).p, np.zeros((4, 0), dtype=int))


def _layers(rng: Generator) -> Sheet:
    return together(*[_sheet(rng)] * 2)


def _turned_over(rng: Generator) -> Sheet:
    given = _sheet(rng)
    return together(given, given._replace(t=given.t[::-1]))


def _in_a_hole(rng: Generator) -> Sheet:
    """An inclusion; its nodes are not merged with the nodes of the sheet around it."""
    given = sheet()
    x, y = given.p[:, given.t].mean(axis=1)
    inside = (abs(x - 2) < 1) & (abs(y - 2) < 1)
    parts = [_only(given, keep) for keep in (inside, ~inside)]
    return together(*parts)


def _only(given: Sheet, cells: ndarray) -> Sheet:
    used, t = np.unique(given.t[:, cells], return_inverse=True)
    return Sheet(given.p[:, used], t.reshape(given.t[:, cells].shape))


_CUT = {"low": 1.0, "high": 3.0}

#: The defects by name.
DEFECTS: dict[str, Defect] = {
    "none": Defect(_sheet, True),
    "two layers": Defect(_layers),
    "a layer turned over": Defect(_turned_over),
    "a layer shifted by a cell": Defect(
        lambda r: together(sheet(), shifted(sheet(), 1, 0))
    ),
    "a layer shifted": Defect(lambda r: together(sheet(), shifted(sheet(), 0.3, 1.3))),
    "a patch on the sheet": Defect(
        lambda r: together(sheet(), shifted(sheet(), 1.3, 1.3, 0.1))
    ),
    "an inclusion": Defect(_in_a_hole),
    "a seam": Defect(_seam(0.0)),
    "a seam of 1e-12": Defect(_seam(4e-12)),
    "a gap of 1 %": Defect(_seam(0.01), True),
    "half a seam": Defect(lambda r: opened(sheet(), 0, 1)),
    "all of a seam": Defect(lambda r: opened(sheet(), 0, 4)),
    "a cut": Defect(lambda r: opened(sheet(), **_CUT), True),
    "an open cut": Defect(lambda r: opened(sheet(), **_CUT, by=0.05), True),
    "a slit from an edge": Defect(lambda r: opened(sheet(), 0, 1, by=0.05), True),
    "a cut and a seam": Defect(
        lambda r: together(opened(sheet(), **_CUT), shifted(sheet(), 4, 0))
    ),
    "hanging nodes": Defect(_hanging),
    "a seam between other meshes": Defect(
        lambda r: together(sheet(), shifted(sheet(3, 3), 4, 0))
    ),
    "a node in two pieces": Defect(
        lambda r: fans((0, 90, 1), (180, 270, 1)), True, "quads"
    ),
    "corners at one place": Defect(lambda r: together(sheet(), shifted(sheet(), 4, 4))),
    "fans that overlap": Defect(
        lambda r: fans((0, 90, 1), (45, 135, 1)), cells="quads"
    ),
    "a fan in a fan": Defect(lambda r: fans((0, 90, 1), (30, 60, 0.3)), cells="quads"),
    "rolled onto itself": Defect(lambda r: rolled(2 * np.pi * 1.3, 0.0)),
    "rolled, and apart": Defect(lambda r: rolled(2 * np.pi * 1.6, 1.4), True),
    "rolled into a slit": Defect(lambda r: rolled(2 * np.pi * 0.97, 0.0), True),
    "rolled into a ring": Defect(lambda r: rolled(2 * np.pi, 0.0)),
    "a node thrown out": Defect(_thrown),
    "an edge collapsed": Defect(_collapsed),
    "an edge of 1e-12": Defect(lambda r: _collapsed(r, 1e-12)),
    "all in a line": Defect(_flat),
    "a bow-tie": Defect(_bow_tie, cells="quads"),
    "a cell twice": Defect(_repeated),
    "three cells at an edge": Defect(_third_at_edge),
    "unused nodes": Defect(_unused),
    "a node twice in a cell": Defect(_twice_in_a_cell),
    "a corner beyond flat": Defect(_reflex, True, "quads"),
    "not a number": Defect(lambda r: _with_coordinate(r, np.nan)),
    "infinite": Defect(lambda r: _with_coordinate(r, -np.inf)),
    "at 1e200": Defect(lambda r: _with_coordinate(r, 1e200)),
    "node -1": Defect(lambda r: _number(r, -1)),
    "node 25": Defect(lambda r: _number(r, 25)),
    "node 2^30": Defect(lambda r: _number(r, 2**30)),
    "no nodes": Defect(_empty),
    "no cells": Defect(_no_cells),
    "in units of 1e-9": Defect(_scaled(1e-9)),
    "in units of 1e9": Defect(_scaled(1e9), True),
    "in units of 1e-200": Defect(_scaled(1e-200), None),
    "in units of 1e90": Defect(_scaled(1e90), None),
    "in units of 1e120": Defect(_scaled(1e120)),
    "far away": Defect(_far(1e6), True),
    "too far away": Defect(_far(1e17)),
    "thin": Defect(_thin(1e-4), True),
    "thinner than round-off": Defect(_thin(1e-14), None),
}


def defective_sheet(name: str, rng: Generator) -> Sheet:
    """A sheet with a defect, sometimes of triangles, moved and renumbered."""
    defect = DEFECTS[name]
    given = defect.make(rng)
    given = Sheet(given.p.astype(float), np.array(given.t))
    if defect.cells == "any" and given.t.size and rng.random() < 0.4:
        given = sheets.triangles(given)
    if 0.1 < np.abs(given.p).max(initial=0) < 1e3:
        given = sheets.moved(given, rng)
    listed = (given.t >= 0) & (given.t < given.p.shape[1])
    return sheets.renumbered(given, rng) if listed.all() and given.t.size else given
