"""What a run of a ply on a tool hands over: fibres of a part, and a flat pattern."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from numpy import ndarray

from ...drape import Axes, Sheet, ToolMesh, fibres_on_tool, flat_pattern
from ...mesh.checks import MeshError
from ...mesh.user_input import printable
from ...solve.result import Result

_PART = ("part.vtu", "part.csv", "part.inp")
_PATTERN = ("pattern.csv", "pattern.svg", "pattern.dxf")


@dataclass(frozen=True, eq=False)
class HandOver:
    """What is to be handed over.

    Attributes
    ----------
    part
        The elements that get fibres; None if there are none.
    curves
        Closed curves of which the flat pattern is made, each of shape (3, n).
    no_curves
        Why there are none; empty if none are wanted.
    trimmed
        Whether the user gives the curve.
    files
        Names of files that `write` may write.
    """

    part: ToolMesh | None = None
    curves: Sequence[ndarray] = ()
    no_curves: str = ""
    trimmed: bool = False
    files: ClassVar[tuple[str, ...]] = (*_PART, *_PATTERN)

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> "HandOver":
        """What the values of a case ask for, nothing where the ply is on no tool.

        Raises
        ------
        ValueError
            If a file is refused.
        """
        part, curve = values.get("part_mesh"), values.get("trim")
        if part is None and curve is None:
            return cls()
        from ... import io  # loads meshio

        mesh = None if part is None else io.read_tool_mesh(part)
        if curve is not None:
            return cls(mesh, [io.read_trimming_curve(curve)], trimmed=True)
        try:
            return cls(mesh, mesh.boundary() if mesh else ())
        except MeshError as error:
            return cls(mesh, no_curves=f"{printable(part)}: {error}")

    def write(self, result: Result, axes: Axes, folder: Path) -> dict[str, Any]:
        """Write what there is, and return figures and why anything is missing.

        Parameters
        ----------
        result
            Result of a ply on a tool.
        axes
            Axes of the ply among those of tool and part.
        folder
            Where the files go.
        """
        if self.part is None and not self.curves:
            return {}
        on_tool = Sheet.of_ply(result.ply, result.u)
        sheet = replace(on_tool, positions=axes.of_tool(on_tool.positions))
        found: dict[str, Any] = {}
        for what, write in (("part", self._fibres), ("pattern", self._pattern)):
            try:
                if not result.converged:
                    raise ValueError("the run stopped early")
                found |= write(sheet, folder)
            except ValueError as error:
                found[what] = f"none: {error}"
        return found

    def missing(self, found: Mapping[str, Any]) -> list[str]:
        """What the user asks for and `write` has not written, and why."""
        asked = ["part"] * (self.part is not None) + ["pattern"] * self.trimmed
        return [f"{what}: {found[what]}" for what in asked if what in found]

    def _fibres(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        from ... import io

        if self.part is None:
            return {}
        fibres = fibres_on_tool(sheet, self.part)
        for name in _PART:
            io.write_fibres(folder / name, fibres)
        return {"part_covered_share_of_elements": float(fibres.covered.mean())}

    def _pattern(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        from ... import io

        if self.no_curves:
            raise ValueError(self.no_curves)
        if not self.curves:
            return {}
        patterns = [flat_pattern(sheet, curve) for curve in self.curves]
        for name in _PATTERN:
            if not name.endswith("dxf") or find_spec("ezdxf"):
                io.write_pattern(folder / name, patterns)
        # Holes go round the other way than the pieces.
        return {
            "pattern_area_mm2": abs(sum(one.signed_area for one in patterns)),
            "pattern_length_mm": sum(pattern.length for pattern in patterns),
        }
