"""Trimming curves and parts whose extent indicates another unit of length."""

import logging
from collections.abc import Sequence
from pathlib import Path

from numpy import ndarray

from .. import io
from ..mesh.extents import OTHER_UNIT, SMALLEST, extent_of
from ..mesh.user_input import printable

log = logging.getLogger(__name__)

# The same of a hole: above the ratio of millimetre and metre.
_HOLE = 2e-3

_STATE = "state its unit in the file, as 'x (m)' in the header of a table"


def trimming_curves(files: Sequence[str | Path]) -> list[ndarray]:
    """Closed curves of files, the outline and then holes, shape (3, n) each.

    Raises
    ------
    ValueError
        If a file is not valid, or the outline extends over less than 5 mm.
    """
    curves = [io.read_curve(file, 3) for file in files]
    if curves and (extent := extent_of(curves[0])) < SMALLEST:
        raise ValueError(
            f"{printable(files[0])}: the curve extends over {extent:.3g} mm: if it is "
            f"in m, {_STATE}"
        )
    return curves


def warn_of_part(file: str, part: ndarray, ply: ndarray) -> None:
    """Warn of a part that extends over much less than the ply."""
    _warn(file, "part", extent_of(part), extent_of(ply), OTHER_UNIT, "export it in mm")


def warn_of_curves(
    files: Sequence[str | Path], curves: Sequence[ndarray], ply: ndarray
) -> None:
    """Warn of trimming curves that extend over much less than the ply."""
    for k, (file, curve) in enumerate(zip(files, curves, strict=True)):
        least = _HOLE if k else OTHER_UNIT
        _warn(file, "curve", extent_of(curve), extent_of(ply), least, _STATE)


def _warn(
    file: str | Path, what: str, extent: float, of_ply: float, least: float, do: str
) -> None:
    if extent < least * of_ply:
        log.warning(
            "%s: the %s extends over %.3g mm, the ply over %.3g mm: if it is not in "
            "mm, %s",
            *(printable(file), what, extent, of_ply, do),
        )
