"""Curves of a drawing, the choice among its layers, and what is ignored."""

import logging
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ...mesh.user_input import excerpt

log = logging.getLogger(__name__)

# Largest number of elements of a drawing.  Patterns of plies have far fewer; arrays of
# blocks and clones of clones multiply them.
_MOST = 100_000

# Segments of a curve for an estimate of its bend, and the most.
_PROBES, _MOST_POINTS = 32, 10_000

#: Largest and smallest sagitta of an arc relative to its radius: of chords over 45°,
#: and of a circle of the most points.
SAGITTA = 1 - float(np.cos(np.pi / 8))
FINEST = (np.pi / _MOST_POINTS) ** 2 / 2

#: Number of layers or rings that a message lists.
LISTED = 5


class Curve(NamedTuple):
    """A polyline of a drawing.

    Parameters
    ----------
    points
        Corners in mm, shape (2, n).
    name
        Name of its edges, or ''.
    where
        Its place in the file, such as ``layer '0'``.
    layers
        Names by which it is chosen.
    flaw
        Why it cannot be read as it is drawn, if so.
    """

    points: ndarray
    name: str
    where: str
    layers: tuple[str, ...]
    flaw: str = ""


def sampled(at: Callable[[ndarray], ndarray], tolerance: float) -> ndarray:
    """Points of a smooth curve of t from 0 to 1, shape (dimension, n).

    The sagitta of a chord, an eighth of the second difference, is within the tolerance.
    """
    probe = at(np.linspace(0, 1, _PROBES + 1))
    bend = float(np.linalg.norm(np.diff(probe, 2), axis=0).max())
    if not np.isfinite(bend):
        return probe
    radius = float(np.linalg.norm(np.ptp(probe, axis=1))) / 2
    allowed = max(min(tolerance, SAGITTA * radius), 1e-300)
    n = np.clip(np.ceil(_PROBES * np.sqrt(bend / (8 * allowed))), 1, _MOST_POINTS)
    return at(np.linspace(0, 1, 1 + int(n)))


def selected(
    what: str,
    curves: Sequence[Curve],
    ignored: Counter[str],
    layer: str | Sequence[str] | None,
    key: Callable[[str], str] = str,
) -> list[Curve]:
    """Curves on the layers, or all; the log names what the file holds besides.

    Parameters
    ----------
    what
        The file, for messages.
    curves, ignored
        Visible curves, and the number of other elements by kind.
    layer
        Name of a layer, or several, or None for all.
    key
        Layers are equal if their keys are equal.

    Raises
    ------
    ValueError
        If there are no curves, a layer has none, or one cannot be read.
    """
    names = ", ".join(f"{n} {excerpt(kind)}" for kind, n in ignored.items())
    if not curves:
        raise ValueError(f"{what} has no lines{names and '; ignored: '}{names}")
    if names:
        log.warning("%s: ignored: %s", what, names)
    chosen = curves if layer is None else _on_layers(what, curves, layer, key)
    for curve in chosen:
        if curve.flaw:
            raise ValueError(curve.flaw)
    return list(chosen)


def _on_layers(
    what: str,
    curves: Sequence[Curve],
    layer: str | Sequence[str],
    key: Callable[[str], str],
) -> list[Curve]:
    wanted = [layer] if isinstance(layer, str) else list(layer)
    if not wanted:
        raise ValueError(f"{what}: layer has no name")
    of_curve = [{key(name) for name in curve.layers} for curve in curves]
    for name in wanted:
        if not any(key(name) in keys for keys in of_curve):
            known = list(dict.fromkeys(one for curve in curves for one in curve.layers))
            listed = ", ".join(repr(excerpt(name)) for name in known[:LISTED])
            more = ", ..." if len(known) > LISTED else ""
            raise ValueError(
                f"{what} has no visible lines on the layer {excerpt(name)!r}; it has "
                f"lines on {listed or 'no layer'}{more}"
            )
    keys = {key(name) for name in wanted}
    return [curve for curve, of in zip(curves, of_curve, strict=True) if keys & of]


def refuse_too_many(what: str, number: int) -> None:
    """Refuse too many elements, as from nested clones."""
    if number > _MOST:
        raise ValueError(f"{what} has more than {_MOST} elements")


def refuse_tolerance(tolerance: float) -> None:
    """Refuse a distance between curves and chords that is not positive and finite."""
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ValueError(f"the tolerance must be positive and finite, got {tolerance}")
