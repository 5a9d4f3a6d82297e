"""Curves of DXF files."""

import logging
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.interpolate import BSpline

from ...mesh.requirements import require, without_messages
from ...mesh.user_input import IN_MM, excerpt, printable, refuse_unit
from ..rings import (
    FINEST,
    SAGITTA,
    Curve,
    refuse_tolerance,
    refuse_too_many,
    sampled,
    selected,
)

log = logging.getLogger(__name__)

# Layer of a DXF file that gives no name; in a block, the layer of the reference.
_NO_NAME = "0"

# Units of a DXF file ($INSUNITS) in mm: the definitions of the units.  The factors of
# ezdxf.units are rounded to eight digits, and lack 8, 9 and 21 to 24.
_FOOT, _SURVEY_FOOT, _AU = 304.8, 1.2e6 / 3937, 149_597_870_700e3
_IN_MM = {
    **{1: _FOOT / 12, 2: _FOOT, 3: 5280 * _FOOT, 4: 1.0, 5: 10.0, 6: 1e3, 7: 1e6},
    **{8: 25.4e-6, 9: 25.4e-3, 10: 3 * _FOOT, 11: 1e-7, 12: 1e-6, 13: 1e-3, 14: 1e2},
    **{15: 1e4, 16: 1e5, 17: 1e12, 18: _AU, 19: 9_460_730_472_580_800e3},
    **{20: _AU * 648_000 / np.pi, 21: _SURVEY_FOOT, 22: _SURVEY_FOOT / 12},
    **{23: 3 * _SURVEY_FOOT, 24: 5280 * _SURVEY_FOOT},
}

_POLYLINES = ("LWPOLYLINE", "POLYLINE")
_CURVES = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", *_POLYLINES)

# Depth relative to the size below which curves are flat, a guard against rounding: it
# changes lengths by less than 1e-6 of the size.
_FLAT = 1e-3

# Direction towards the viewer: from above, else from the front, else from the right.
_FROM = 1e-6, -1e-3, 1.0

# Bit of the flags of a vertex: control point of a spline, which is not on the curve.
_CONTROL_POINT = 16


def curves_of_dxf(
    path: str | os.PathLike[str],
    tolerance: float,
    unit: str | None = None,
    layer: str | Sequence[str] | None = None,
    in_space: bool = False,
) -> list[Curve]:
    """Visible lines, polylines, arcs and splines of the model space, named by layer.

    Parameters
    ----------
    path, tolerance, unit, layer
        See `Outline.from_dxf`.
    in_space
        Return points in space, shape (3, n), instead of in the plane of the curves.

    Raises
    ------
    ModuleNotFoundError
        If ezdxf is not installed.
    ValueError
        If the file cannot be read, its unit is unknown, a coordinate is not finite, no
        curve is visible on a layer, or the curves are to be and are not in one plane.
    """
    refuse_tolerance(tolerance)
    refuse_unit(unit)
    what = printable(path)
    drawing = _drawing(path, what)
    scale = _scale(what, drawing, unit)
    reader = _Reader(what, drawing, tolerance / scale)
    curves = [
        Curve(scale * x.T, "" if on == _NO_NAME else on, f"layer {on!r}", (on,))
        for x, on in reader.curves(drawing.modelspace(), np.eye(4))
    ]
    chosen = selected(what, curves, reader.ignored, layer, str.casefold)
    if not all(np.isfinite(curve.points).all() for curve in chosen):
        raise ValueError(f"{what}: coordinates are not finite")
    return chosen if in_space else _in_plane(what, chosen)


def _drawing(path: str | os.PathLike[str], what: str) -> Any:
    """The file as read by ezdxf."""
    require("reading a .dxf file", "dxf", "ezdxf")
    import ezdxf

    try:
        with without_messages():
            drawing = ezdxf.readfile(path)
            drawing.modelspace()
        return drawing
    except Exception as error:  # a damaged file raises errors of any type
        if isinstance(error, OSError) and error.filename is not None:
            raise
        raise ValueError(
            f"{what}: the file is damaged, or is not a DXF file: save it again"
        ) from None


def _scale(what: str, drawing: Any, unit: str | None) -> float:
    """Unit of length in mm."""
    code = drawing.header.get("$INSUNITS", 0)
    if unit is not None:
        if _IN_MM.get(code, IN_MM[unit]) != IN_MM[unit]:
            log.warning(
                "%s: lengths are read in %s, but $INSUNITS states another unit",
                *(what, unit),
            )
        return IN_MM[unit]
    if code == 0:
        log.warning("%s states no unit: lengths are read in mm", what)
        return 1.0
    if code not in _IN_MM:
        raise ValueError(
            f"{what}: the unit {excerpt(str(code))} of $INSUNITS is unknown: specify "
            "the unit"
        )
    return float(_IN_MM[code])


class _Reader:
    """Curves of the model space and of its blocks, and what is ignored."""

    def __init__(self, what: str, drawing: Any, tolerance: float) -> None:
        self._what, self._tolerance, self._visited = what, tolerance, 0
        self.ignored: Counter[str] = Counter()
        layers = {layer.dxf.name.casefold(): layer for layer in drawing.layers}
        self._off = {name for name, layer in layers.items() if layer.is_off()}
        self._frozen = {name for name, layer in layers.items() if layer.is_frozen()}

    def curves(
        self,
        entities: Iterable[Any],
        M: ndarray,
        layer: str = _NO_NAME,
        blocks: tuple[str, ...] = (),
    ) -> Iterator[tuple[ndarray, str]]:
        """Points in space, shape (n, 3), and layer of each curve.

        Parameters
        ----------
        entities
            Entities of the model space or of a block.
        M
            Matrix that maps rows (x, y, z, 1) to the model space, shape (4, 4).
        layer
            Layer of the reference to the block.
        blocks
            Names of the blocks around the entities.
        """
        for entity in entities:
            self._visited += 1
            refuse_too_many(self._what, self._visited)
            kind, on = entity.dxftype(), _attribute(entity, "layer", _NO_NAME)
            on = layer if on == _NO_NAME else on
            if self._is_hidden(entity, kind, on.casefold()):
                self.ignored[f"hidden {kind}"] += 1
            elif kind == "INSERT":
                yield from self._of_block(entity, M, on, blocks)
            elif kind in _CURVES and not _is_mesh(entity):
                points = self._points(entity, M, on)
                if len(points) > 1:
                    yield points, on
                else:
                    self.ignored[f"empty {kind}"] += 1
            else:
                self.ignored[kind] += 1

    def _is_hidden(self, entity: Any, kind: str, layer: str) -> bool:
        """True on hidden layers; one that is off hides only curves, no reference."""
        off = kind != "INSERT" and layer in self._off
        return off or layer in self._frozen or bool(_attribute(entity, "invisible", 0))

    def _of_block(
        self, insert: Any, M: ndarray, layer: str, blocks: tuple[str, ...]
    ) -> Iterator[tuple[ndarray, str]]:
        from ezdxf.xclip import XClip

        name, block = insert.dxf.name, insert.block()
        what = f"{self._what}: the block {excerpt(name)!r} on layer {layer!r}"
        clip = XClip(insert)
        if block is None or block.block.is_xref:
            raise ValueError(f"{what} is not in the file: insert it there")
        if name in blocks:
            raise ValueError(f"{what} contains itself")
        if clip.has_clipping_path and clip.is_clipping_enabled:
            raise ValueError(f"{what} is clipped, which is not supported: trim it")
        refuse_too_many(self._what, insert.mcount)
        self.ignored.update(attrib.dxftype() for attrib in insert.attribs)
        for one in insert.multi_insert() if insert.mcount > 1 else [insert]:
            step = np.reshape(list(one.matrix44()), (4, 4))
            yield from self.curves(block, step @ M, layer, (*blocks, name))

    def _points(self, entity: Any, M: ndarray, layer: str) -> ndarray:
        try:
            points = _flattened(entity, np.inf)
            is_level = (points[:, 2] == points[:1, 2]).all()
            axes = 2 if is_level else 3  # z may have another scale
            stretch = max(float(np.linalg.norm(M[:axes, :3], 2)), 1e-300)
            points = _flattened(entity, self._tolerance / stretch)
        except Exception:  # curves without control points and the like
            raise ValueError(
                f"{self._what}: {entity.dxftype()} on layer {layer!r} is not valid: "
                "draw it again"
            ) from None
        return points @ M[:3, :3] + M[3, :3]


def _attribute(entity: Any, name: str, default: Any) -> Any:
    """Attribute of an entity; entities of unknown types have none."""
    dxf = entity.dxf
    return dxf.get(name, default) if dxf.is_supported(name) else default


def _is_mesh(entity: Any) -> bool:
    kinds = ("is_polygon_mesh", "is_poly_face_mesh")
    return any(getattr(entity, kind, False) for kind in kinds)


def _flattened(entity: Any, tolerance: float) -> ndarray:
    """Points along a curve, shape (n, 3), whose chords stay within the tolerance."""
    kind = entity.dxftype()
    if kind in _POLYLINES:
        if kind == "POLYLINE":
            on_curve = [v for v in entity.vertices if not v.dxf.flags & _CONTROL_POINT]
            entity.vertices[:] = on_curve
        parts = [_flattened(part, tolerance) for part in entity.virtual_entities()]
        return _chained(parts)
    if kind == "SPLINE":
        return _of_spline(entity.construction_tool(), tolerance)
    if kind == "LINE":
        corners = [entity.dxf.start, entity.dxf.end]
    else:
        dxf = entity.dxf
        if kind == "ELLIPSE":
            radius = dxf.major_axis.magnitude
            if np.isclose(dxf.end_param - dxf.start_param, 2 * np.pi, rtol=1e-9):
                dxf.start_param, dxf.end_param = 0.0, 2 * np.pi  # ezdxf drops others
        else:
            radius = abs(dxf.radius)
        sagitta = np.clip(tolerance, FINEST * radius, SAGITTA * radius)
        corners = list(entity.flattening(sagitta))
    return np.array([tuple(corner) for corner in corners]).reshape(-1, 3)


def _of_spline(spline: Any, tolerance: float) -> ndarray:
    """Points of a B-spline, shape (n, 3).

    ezdxf evaluates it over all knots, beyond the ends of a periodic one.
    """
    knots, degree = np.array(spline.knots()), spline.order - 1
    points = np.array([tuple(x) for x in spline.control_points])
    weights = np.array(spline.weights() or [1.0] * len(points))[:, None]
    curve = BSpline(knots, np.hstack([weights * points, weights]), degree)

    def at(t: ndarray) -> ndarray:
        x = curve(t).T
        return np.asarray(x[:3] / x[3])

    breaks = np.unique(knots[degree : len(points) + 1])
    parts = [
        sampled(lambda s, a=a, b=b: at(a + s * (b - a)), tolerance).T  # type: ignore
        for a, b in pairwise(breaks)
    ]
    return np.vstack([parts[0], *(part[1:] for part in parts[1:])])


def _chained(parts: list[ndarray]) -> ndarray:
    """Join the parts of a polyline; arcs may run backwards."""
    if not parts:
        return np.zeros((0, 3))
    lines = parts[:1]
    for i, part in enumerate(parts[1:]):
        # From the last and the first point of the last part to both ends of the next.
        gaps = np.linalg.norm(lines[-1][[-1, 0], None] - part[[0, -1]], axis=2)
        if i == 0 and gaps[1].min() < gaps[0].min():
            lines, gaps = [lines[0][::-1]], gaps[::-1]
        lines.append(part if gaps[0, 0] <= gaps[0, 1] else part[::-1])
    return np.vstack([lines[0], *(line[1:] for line in lines[1:])])


def _in_plane(what: str, curves: list[Curve]) -> list[Curve]:
    """Curves in space, with points of shape (3, n), in their common plane.

    Curves parallel to the x-y plane are seen from above.
    """
    p = np.hstack([curve.points for curve in curves])
    depth, axes = _FLAT * np.ptp(p, axis=1).max(), np.eye(3)[:2]
    tilted = [curve for curve in curves if np.ptp(curve.points[2]) > depth]
    if tilted:
        from ezdxf.math import OCS

        centred = p - p.mean(axis=1, keepdims=True)
        normal = np.linalg.eigh(centred @ centred.T)[1][:, 0]
        if (np.abs(normal @ centred) > depth).any():
            raise ValueError(
                f"{what}: a curve on {tilted[0].where} does not lie in the plane of "
                "the others, or is not flat: draw all in the x-y plane"
            )
        normal *= np.sign(normal @ _FROM)
        axes = np.array([tuple(OCS(normal).to_wcs(axis)) for axis in axes])
        log.warning("%s: the curves lie in a tilted plane, which is laid flat", what)
    return [curve._replace(points=axes @ curve.points) for curve in curves]
