"""Plies of a lay-up that are formed together."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..declarations import MOST_FRICTION
from ..declarations.scenes import Formed
from ..fabric import Fabric
from ..fabric.layup import layup_angles_deg, turned
from ..mesh.user_input import errors_in, real_numbers, shortened
from ..ply.terms import Load, Term

if TYPE_CHECKING:
    from ..contact.stack import Stack
    from ..ply import Ply


@dataclass(frozen=True, eq=False)
class Plies:
    """Plies of a lay-up, from the bottom to the top.

    Attributes
    ----------
    angles_deg
        Angle in degrees by which the fabric of each ply is turned, counterclockwise.
    thickness
        Thickness of each ply in mm.
    friction
        See `Stack`.
    fabrics
        Fabric of each ply before it is turned, or None for the fabric of the case;
        empty if all are None.
    """

    angles_deg: tuple[float, ...]
    thickness: tuple[float, ...]
    friction: Any = 0.0
    fabrics: tuple[Fabric | None, ...] = ()

    def stack(
        self,
        fabric: Fabric,
        ply: "Callable[[Fabric], Ply]",
        terms: Iterable[Term | Load],
    ) -> "Stack":
        """Stack of the plies.

        Parameters
        ----------
        fabric
            Fabric of plies without their own, before it is turned.
        ply
            Function that returns a ply of a fabric.
        terms
            Tools and loads.

        Raises
        ------
        ValueError
            See `Stack`.
        """
        from ..contact.stack import Stack

        fabrics = self.fabrics or (None,) * len(self.angles_deg)
        pairs = zip(fabrics, self.angles_deg, strict=True)
        plies = [ply(turned(own or fabric, angle)) for own, angle in pairs]
        of_plies: dict[str, Any] = {"thickness": self.thickness, "terms": terms}
        return Stack(plies, friction=self.friction, **of_plies)


def plies_of(name: str, layup: str | Sequence[float], given: Formed) -> Plies:
    """Plies of the lay-up of a scene.

    Parameters
    ----------
    name
        Name of the scene, for messages.
    layup
        The lay-up as a text, or angles in degrees.
    given
        Further parameters of the scene.

    Raises
    ------
    ValueError
        If the lay-up cannot be read or has one ply, a thickness is negative, a
        coefficient of friction is not between 0 and 2, or a table of them is not
        symmetric or has not a row for each ply.
    """
    with errors_in(f"{name}: "):
        angles = _angles_deg(layup)
        if len(angles) < 2:
            raise ValueError(
                "layup must have at least two plies: omit it for one ply, and turn its "
                "fabric by fibres"
            )
        thickness = real_numbers("ply_thickness", given.ply_thickness)
        n = len(angles)
        if thickness.shape not in ((), (n,)):
            raise ValueError(
                f"ply_thickness must be one length in mm, or one for each of {n} "
                f"plies, got {shortened(given.ply_thickness)}"
            )
        if not (np.isfinite(thickness) & (thickness >= 0)).all():
            raise ValueError(
                "ply_thickness must be a length of at least 0 mm, got "
                f"{shortened(given.ply_thickness)}"
            )
        if not callable(given.ply_friction):
            _refuse_friction(given.ply_friction, n)
    return Plies(
        angles,
        tuple(np.broadcast_to(thickness, n).tolist()),
        given.ply_friction,
    )


def _angles_deg(layup: str | Sequence[float]) -> tuple[float, ...]:
    if isinstance(layup, str):
        return layup_angles_deg(layup)
    angles = real_numbers("layup", layup)
    if angles.ndim != 1 or not angles.size or not np.isfinite(angles).all():
        raise ValueError(
            "layup must be a text such as '[0/90, ±45]s', or finite angles in degrees, "
            f"got {shortened(layup)}"
        )
    return tuple(angles.tolist())


def _refuse_friction(friction: Any, n: int) -> None:
    """Refuse a coefficient, or a table of coefficients of n plies."""
    ragged = isinstance(friction, list | tuple) and any(
        not isinstance(row, list | tuple) or len(row) != n for row in friction
    )
    table = None if ragged else real_numbers("ply_friction", friction)
    if table is None or table.shape not in ((), (n, n)):
        raise ValueError(
            f"ply_friction must be one coefficient, or {n} rows of {n} coefficients "
            f"for the pairs of {n} plies, got {shortened(friction)}"
        )
    if not ((table >= 0) & (table <= MOST_FRICTION)).all():
        raise ValueError(
            f"ply_friction must be between 0 and {MOST_FRICTION:g}, got "
            f"{shortened(friction)}"
        )
    if table.ndim and (table != table.T).any():
        i, j = np.argwhere(table != table.T)[0]
        raise ValueError(
            f"ply_friction must be symmetric, but it is {table[i, j]:g} in row {i + 1} "
            f"and column {j + 1}, and {table[j, i]:g} in row {j + 1} and column "
            f"{i + 1}: set both to the same coefficient"
        )
