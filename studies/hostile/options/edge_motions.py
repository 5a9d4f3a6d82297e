"""How the edges of each scene move, by its documentation."""

from typing import Any

import numpy as np
from numpy import ndarray

from .reader import RunLine

#: Radius of the circle onto which the strip is bent, in mm.
_RADIUS = 55.0
#: Length over which a fibre of the trellis turns by the bend angle, in mm.
_SIDE = 100.0


def fibres(line: RunLine) -> ndarray:
    """Inclinations of warp and weft in radians, before the scene is turned.

    Those of a bias extension are inclinations of lines, between 0 and 180 degrees.
    """
    v = line.values
    degrees = np.array([v.get("warp", 0.0), v.get("weft", 90.0)])
    return np.radians(degrees % 180 if line.scene == "bias_extension" else degrees)


def sides(line: RunLine) -> tuple[float, float]:
    """Width and height of the mesh that is made, in mm."""
    if line.scene == "strip":
        return 40.0, 60.0
    if line.scene == "bias_extension":
        share = 0.5 if line.values["part"] == "half" else 1.0
        return share * 50.0, 100.0 * float(np.tan(fibres(line)[0]))
    if line.scene == "specimen":
        return line.values["width"], line.values["height"]
    return 100.0, 100.0


def conditions(line: RunLine) -> set[str]:
    """Names of the conditions."""
    if line.scene == "strip":
        return {"bottom", "right"}
    if line.scene == "bias_extension":
        return {"bottom", "top"} | (
            {"axis"} if line.values["part"] == "half" else set()
        )
    if line.scene == "specimen":
        moves = line.values["move"]
        return {name for name, move in moves if move != ["free", "free"]}
    free = line.values.get("free", [])
    rollers = {side for side, _ in line.values.get("roller", [])}
    driven = next(s for s in ("top", "right", "bottom", "left") if s not in free)
    return {"held", driven} | rollers


def misplaced(line: RunLine, X: ndarray, u: ndarray, t: float) -> float:
    """The largest distance of an edge's node from its place at load factor t.

    Parameters
    ----------
    line
        The command line.
    X, u
        Nodes of a ply that fills a rectangle with its lower left corner at the origin,
        and their displacements, before the scene is turned; shape (2, n).
    t
        Load factor.
    """
    width, height = X.max(axis=1)
    on = {
        "left": X[0] < 1e-9 * width,
        "right": X[0] > (1 - 1e-9) * width,
        "bottom": X[1] < 1e-9 * height,
        "top": X[1] > (1 - 1e-9) * height,
    }
    if line.scene == "strip":
        R = _RADIUS / t if t else np.inf
        arc = R * (1 - np.cos(X[1] / R)) if t else 0 * X[1]
        off = [u[:, on["bottom"]].ravel(), (u[0] - arc)[on["right"]]]
    elif line.scene == "bias_extension":
        off = _off_clamps(line.values, on, X, u, t)
    elif line.scene == "specimen":
        off = [
            u[axis, on[side]] - t * component
            for side, move in line.values["move"]
            for axis, component in enumerate(move)
            if component != "free"
        ]
    else:
        off = _off_frame(line.values, on, trellis(line, X, t) - X - u)
    return float(np.abs(np.concatenate(off)).max())


def _off_clamps(
    v: dict[str, Any], on: dict[str, ndarray], X: ndarray, u: ndarray, t: float
) -> list[ndarray]:
    theta, gamma = np.radians(v["warp"]) % np.pi, np.radians(v["shear-angle"])
    half = v["part"] == "half"
    width, height = X.max(axis=1) * ((2, 1) if half else (1, 1))
    length = (height / np.sin(theta) - width / np.cos(theta)) / 2
    rise = 2 * length * (np.sin(theta + t * gamma / 2) - np.sin(theta))
    off = [u[:, on["bottom"]].ravel(), u[0, on["top"]], u[1, on["top"]] - rise]
    return [*off, u[0, on["right"]]] if half else off


def _off_frame(
    v: dict[str, Any], on: dict[str, ndarray], off: ndarray
) -> list[ndarray]:
    carried, rollers = set(v.get("free", [])), dict(v.get("roller", []))
    carried |= set(rollers)
    held = np.any([on[side] for side in on if side not in carried], axis=0)
    distances = [off[:, held].ravel()]
    for side, degrees in rollers.items():
        a = np.radians(degrees)
        distances.append(-np.sin(a) * off[0, on[side]] + np.cos(a) * off[1, on[side]])
    return distances


def trellis(line: RunLine, X: ndarray, t: float) -> ndarray:
    """Positions of points in a trellis whose fibres bend onto circles."""
    v, (warp, weft) = line.values, fibres(line)
    gamma = np.radians(v["shear-angle"])
    A = np.array([[np.cos(warp), np.cos(weft)], [np.sin(warp), np.sin(weft)]])
    s = np.linalg.solve(A, X)
    if line.scene == "picture_frame":
        turns = (0.0, 0.0), (-t * gamma, 0.0)
    else:
        bend = t * np.radians(v["bend"]) / _SIDE
        turns = (t * gamma / 2, -bend), (-t * gamma / 2, bend)
    return sum(
        _arc(angle + turn, curvature, along)
        for angle, (turn, curvature), along in zip((warp, weft), turns, s, strict=True)
    )


def _arc(start: float, curvature: float, s: ndarray) -> ndarray:
    """∫₀ˢ (cos, sin)(start + curvature s) ds: a chord of an arc, shape (2, n)."""
    half = curvature * s / 2
    return (
        s
        * np.sinc(half / np.pi)
        * np.stack([np.cos(start + half), np.sin(start + half)])
    )
