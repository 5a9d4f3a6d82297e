"""Course of a ply over the travel of a punch, step by step; requires NumPy only."""

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import numpy as np
from numpy import ndarray

#: State near a displacement at a travel in mm, or None, and number of linear solves.
Search = Callable[[ndarray, float], tuple[ndarray | None, int]]

#: Force of the punch on the ply in N at a displacement and a travel.
Force = Callable[[ndarray, float], float]

# Share of a step below which a course ends.  Chosen: 0.1 mm in ten steps of 75 mm.
_SHORTEST = 2.0**-6


@dataclass(frozen=True, eq=False)
class Course:
    """States of a ply over the travel of the punch, as far as they were found.

    Attributes
    ----------
    travels
        Travel of the punch in mm, shape (n,).
    forces
        Force of the punch on the ply in N, shape (n,).
    draw_in
        In-plane motion in mm of the ply at the end of the x axis and at the far corner,
        shape (n, 2).
    solves, seconds
        Linear solves and processor time up to each state, failed steps included, shape
        (n,).
    failure
        Why the course ends early; empty if it does not.
    """

    travels: ndarray
    forces: ndarray
    draw_in: ndarray
    solves: ndarray
    seconds: ndarray
    failure: str = ""

    @classmethod
    def of(cls, rows: ndarray, failure: str) -> "Course":
        """Course from `formed`."""
        travels, forces, *draw_in, solves, seconds = rows.T
        ends = np.array(draw_in).T
        return cls(travels, forces, ends, solves.astype(int), seconds, failure)


def formed(
    nodes: ndarray, search: Search, force: Force, travels: ndarray
) -> tuple[ndarray, str]:
    """Form a ply at rest; a step that fails is halved.

    Parameters
    ----------
    nodes
        Nodes of a quarter of the ply, shape (n_nodes, 2); node i has the unknowns 3i to
        3i + 2.
    search, force
        See `Search` and `Force`.
    travels
        Travels of the punch in mm, ascending.

    Returns
    -------
    tuple
        Rows of travel, force, both draw-ins, solves and seconds, shape (n, 6); the
        reason why the course ends early, or an empty text.
    """
    start, ends = process_time(), ends_of(nodes)
    u, at, solves = np.zeros(3 * len(nodes)), 0.0, 0
    rows: list[list[float]] = []
    for travel in travels:
        whole = step = travel - at
        while at < travel:
            to = min(at + step, travel)
            found, taken = search(u, to)
            solves += taken
            if found is not None:
                u, at = found, to
            elif (step := step / 2) < _SHORTEST * whole:
                return _table(rows), f"no state at a travel of {to:.4g} mm"
        cost = solves, process_time() - start
        rows.append([at, force(u, at), *draw_in(u, ends), *cost])
    return _table(rows), ""


def ends_of(nodes: ndarray) -> list[int]:
    """Numbers of the nodes at the end of the x axis and at the far corner."""
    side = nodes.max()
    return [
        int(np.flatnonzero(np.isclose(nodes, end).all(axis=1))[0])
        for end in ((side, 0.0), (side, side))
    ]


def draw_in(u: ndarray, ends: list[int]) -> ndarray:
    """In-plane motion of nodes in mm."""
    drawn: ndarray = np.hypot(*u.reshape(-1, 3)[ends, :2].T)
    return drawn


def _table(rows: list[list[float]]) -> ndarray:
    return np.array(rows).reshape(-1, 6)
