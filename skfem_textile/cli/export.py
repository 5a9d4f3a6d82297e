"""Fibres in the part and flat patterns, of a run or of a finished one."""

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from glob import escape
from pathlib import Path, PurePosixPath
from typing import Any, ClassVar

import numpy as np
from numpy import ndarray

from .. import io
from ..cases.build import refuse_incomplete_exports
from ..cases.finished import read_result
from ..cases.read import converted
from ..cases.schema import PATTERN_KINDS, Output
from ..io.file_numbers import errors_about
from ..io.tools import refuse_unit_of_part
from ..mesh.checks import MeshError
from ..mesh.graph import components, edges_of
from ..mesh.requirements import is_installed, lacks, require
from ..mesh.user_input import printable
from ..nets.flat_pattern import FlatPattern, flat_pattern
from ..nets.sheet import REACH, Sheet, fibres_on_tool
from ..solve.quantities import Quantity, first_rows
from ..surfaces.tool_mesh import ToolMesh
from .interruption import held
from .output import STOPPED_EARLY, complain, say
from .page import say_rows
from .result_folder import ResultFolder
from .run_options import as_typed

_PART = ("part.vtu", "part.csv", "part.inp")

# Folder of the copy of a deck.
_DECK = "deck"

#: Files of flat patterns.
PATTERN = tuple(f"pattern.{kind}" for kind in PATTERN_KINDS)

# Beginning of the reason why an export is missing.
_NOT = "not written"

# Parameters of the layers in a deck.
_LAYERS = "thickness", "material", "calculix"

# Figures of exports that are printed, or the reasons why there are none.
_FIRST = (
    Quantity("Part", "part"),
    Quantity("Deck", "deck"),
    Quantity(
        *("Part covered", "part_covered_share_of_elements", "%"),
        note=" of its elements",
    ),
    Quantity("Flat pattern", "pattern"),
    Quantity("Flat pattern", "pattern_area_mm2", "mm²"),
)


def run(options: argparse.Namespace) -> int:
    """Export the ply of a finished run into its folder; returns the exit code.

    Raises
    ------
    ValueError
        If there is nothing to export, or a file is refused.
    OSError, OutputError
        If the folder cannot be written.
    """
    export = PartExport.of_options(options)
    if not export:
        raise ValueError("nothing to export: specify --part-mesh, --deck or --trim")
    finished = read_result(options.folder)
    if finished.case.scene.dimension == 2:
        raise ValueError(
            f"the ply in {printable(options.folder)} is in its plane: exports require "
            "tools"
        )
    what = "" if finished.summary.get("converged") else "the run stopped early"
    export.refuse_folder(options.folder)
    out = ResultFolder(
        options.folder, ("summary.json", *export.files(finished.summary))
    )
    with held(), out as folder:
        figures = export.write(finished.sheet(), what, folder)
        summary = export.added(finished.summary, figures)
        io.write_summary(summary, folder / "summary.json")
    say_rows(first_rows({**figures, "first": [one.declared() for one in _FIRST]}))
    say(f"results written to {printable(options.folder)}{out.removed_text()}")
    if missing := export.missing(figures):
        complain("; ".join(missing))
        return STOPPED_EARLY
    return 0


def decks_in(folder: Path) -> tuple[str, ...]:
    """Files of the deck that an earlier export wrote into a folder."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        return _deck_files(summary)
    except (OSError, ValueError, AttributeError, TypeError):
        return ()


def _deck_files(summary: Mapping[str, Any]) -> tuple[str, ...]:
    """Glob patterns of the files below the folder of the deck, and of no others."""
    names = map(str, summary.get("deck_files", ()))
    parts = ((name, PurePosixPath(name).parts) for name in names)
    return tuple(
        escape(name)
        for name, path in parts
        if path[:1] == (_DECK,) and ".." not in path[1:]
    )


def write_patterns(
    folder: Path,
    patterns: Sequence[FlatPattern],
    kinds: Sequence[str] = PATTERN_KINDS,
) -> None:
    """Write flat patterns; a .dxf only if ezdxf is installed."""
    for kind in kinds:
        name = f"pattern.{kind}"
        if kind == "dxf" and not is_installed("ezdxf"):
            say(f"not written: {lacks(name, 'dxf', 'ezdxf')}")
        else:
            io.write_pattern(folder / name, patterns)


@dataclass(frozen=True, eq=False)
class PartExport:
    """Export of a ply: elements of the part, and curves that trim the pattern.

    ``curves`` are closed, each (3, n); ``no_curves`` is the reason why there are none,
    and ``trimmed`` is true for user-supplied curves: the outline, then holes, and
    ``requested`` if the pattern must be written. ``reach``
    is the largest distance of the part from the ply in mm, and ``kinds`` are kinds of
    files of the pattern. A deck has the ``layers`` of the ply.
    """

    part: ToolMesh | None = None
    deck: io.PartDeck | None = None
    layers: Mapping[str, Any] = field(default_factory=dict)
    curves: Sequence[ndarray] = ()
    no_curves: str = ""
    trimmed: bool = False
    reach: float | None = None
    kinds: Sequence[str] = PATTERN_KINDS
    requested: bool = False
    all_files: ClassVar[tuple[str, ...]] = (*_PART, *PATTERN)

    @classmethod
    def read(cls, output: Output) -> "PartExport":
        """Read the part and the curves that a case names."""
        part, trim = output.part_mesh or output.deck, output.trim
        if part is None and trim is None:
            return cls()
        if "dxf" in (output.pattern or ()):
            require("a .dxf of the pattern", "dxf", "ezdxf")
        own = output.part_mesh
        mesh = None if own is None else io.read_tool_mesh(own)
        deck = None if output.deck is None else io.read_part_deck(output.deck)
        of_deck = None if deck is None else deck.mesh
        for file, one in ((own, mesh), (output.deck, of_deck)):
            with errors_about(str(file)):
                refuse_unit_of_part(one)
        others: dict[str, Any] = {"reach": output.part_reach_mm}
        others["kinds"] = output.pattern or PATTERN_KINDS
        others["requested"] = output.pattern is not None or trim is not None
        if deck is not None:
            layers = output.thickness_mm, output.material, output.calculix
            others |= {"deck": deck, "layers": dict(zip(_LAYERS, layers, strict=True))}
            mesh = mesh or deck.mesh
        if trim is not None:
            files = (trim,) if isinstance(trim, str) else trim
            curves = [io.read_curve(file, 3) for file in files]
            return cls(mesh, curves=curves, trimmed=True, **others)
        try:
            return cls(mesh, curves=mesh.boundary() if mesh else (), **others)
        except MeshError as error:
            return cls(mesh, no_curves=f"{printable(part)}: {error}", **others)

    @classmethod
    def of_options(
        cls, options: argparse.Namespace, has_pattern: bool = False
    ) -> "PartExport":
        """Read what the options of a command name, which may have its own pattern."""
        keys = {
            path.removeprefix("output."): value
            for path, value in vars(options).items()
            if path.startswith("output.")
        }
        try:
            output = converted("output", keys, Output)
            refuse_incomplete_exports(output, has_pattern)
            return cls.read(output)
        except ValueError as error:
            raise ValueError(as_typed(str(error), options)) from None

    def __bool__(self) -> bool:
        """True if there is something to export."""
        return self.part is not None or bool(self.curves)

    def refuse_folder(self, out: Path) -> None:
        """Refuse a deck that its copy would replace."""
        if self.deck and (out / _DECK).resolve() in self.deck.path.resolve().parents:
            raise ValueError(
                f"{printable(self.deck.path)}: its copy is written into this folder: "
                "move the deck"
            )

    def files(self, summary: Mapping[str, Any]) -> tuple[str, ...]:
        """Files that `write` replaces, of an export with this summary."""
        names = [*_PART] if self.part else []
        names += [*PATTERN] if self.curves or self.no_curves else []
        names += _deck_files(summary) if self.deck else ()
        return tuple(names)

    def write(self, sheet: Sheet, reason: str, folder: Path) -> dict[str, Any]:
        """Write the exports; returns figures, and the reason for each missing export.

        The sheet is in the axes of the part.  ``reason`` says why there is no export
        from it; empty if there is one.
        """
        figures: dict[str, Any] = {}
        writers = self._fibres, self._with_layers, self._pattern
        for what, write in zip(("part", "deck", "pattern"), writers, strict=True):
            try:
                if reason:
                    raise ValueError(reason)
                figures |= write(sheet, folder)
            except ValueError as error:
                figures[what] = f"{_NOT}: {error}"
        return figures

    @staticmethod
    def added(summary: Mapping[str, Any], figures: Mapping[str, Any]) -> dict[str, Any]:
        """Summary of a run with the figures of `write`, which are printed too."""
        own = [quantity.declared() for quantity in _FIRST]
        first = [one for one in summary["first"] if one not in own]
        kept = {k: x for k, x in summary.items() if not str(x).startswith(_NOT)}
        return {**kept, **figures, "first": [*first, *(own if figures else ())]}

    def missing(self, figures: Mapping[str, Any]) -> list[str]:
        """Requested exports that `write` has not written, with reasons."""
        requested = ["part"] * (self.part is not None) + ["pattern"] * self.requested
        requested += ["deck"] * (self.deck is not None)
        reasons = {what: str(figures.get(what, "")) for what in requested}
        return [f"{k}: {text}" for k, text in reasons.items() if _NOT in text]

    def _fibres(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        if self.part is None:
            return {}
        fibres = fibres_on_tool(sheet, self.part, reach=self.reach)
        for name in _PART:
            io.write_fibres(folder / name, fibres)
        return {
            "part_covered_share_of_elements": float(fibres.covered.mean()),
            "part_reach_mm": self._reach(sheet, self.part),
        }

    def _reach(self, sheet: Sheet, part: ToolMesh) -> float:
        """Largest distance of the part from the ply in mm."""
        longest = max(sheet.longest_edge, float(part.longest_edges().max()))
        return self.reach or REACH * longest

    def _covered(self, sheet: Sheet) -> ToolMesh:
        """Connected pieces of the part on which the ply lies, without other skins."""
        assert self.part is not None
        cells, points = self.part.cells, self.part.points
        covered = fibres_on_tool(sheet, self.part, reach=self.reach).covered
        edges = edges_of(cells)[0]
        piece = components(points.shape[1], edges)
        of_element = np.concatenate([piece[cell[0]] for cell in cells])
        kept = np.isin(piece, of_element[covered])
        return ToolMesh(points, tuple(cell[:, kept[cell[0]]] for cell in cells))

    def _with_layers(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        if self.deck is None:
            return {}
        fibres = fibres_on_tool(sheet, self.deck.mesh, reach=self.reach)
        (folder / _DECK).mkdir()
        files = io.write_part_deck(folder / _DECK, self.deck, fibres, **self.layers)
        names = [
            file.relative_to(folder).as_posix()
            for file in (folder / _DECK).rglob("*")
            if file.is_file()
        ]
        deck = files[0].relative_to(folder).as_posix()
        return {"deck": deck, "deck_files": sorted(names)}

    def _pattern(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        if self.no_curves:
            raise ValueError(self.no_curves)
        if not self.curves:
            return {}
        if self.trimmed:
            outer, *holes = self.curves
            patterns = [flat_pattern(sheet, outer, holes=holes, reach=self.reach)]
            area = patterns[0].area
        else:  # holes of the part have the opposite orientation
            assert self.part is not None
            reach, covered = self._reach(sheet, self.part), self._covered(sheet)
            curves = covered.boundary()
            patterns = [flat_pattern(sheet, x, reach=reach) for x in curves]
            area = abs(sum(one.signed_area for one in patterns))
        write_patterns(folder, patterns, self.kinds)
        length = sum(pattern.length for pattern in patterns)
        return {"pattern_area_mm2": area, "pattern_length_mm": length}
