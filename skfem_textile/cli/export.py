"""Fibres in the part and flat patterns, of a run or of a finished one."""

import argparse
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from glob import escape
from pathlib import Path, PurePosixPath
from typing import Any, ClassVar

import numpy as np
from numpy import ndarray

from .. import io
from ..cases.build import refuse_incomplete
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
from ..nets.sheet import FibresInSpace, Sheet, default_reach, fibres_on_tool
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

    ``output`` names the files and parameters, ``part`` and ``deck`` are what they
    contain. ``curves`` are closed, each (3, n): the curves of ``output.trim``, the
    outline, then holes, or the boundary of the part; ``no_curves`` is the reason why
    there are none.
    """

    output: Output
    part: ToolMesh | None = None
    deck: io.PartDeck | None = None
    curves: Sequence[ndarray] = ()
    no_curves: str = ""
    all_files: ClassVar[tuple[str, ...]] = (*_PART, *PATTERN)

    @classmethod
    def read(cls, output: Output) -> "PartExport":
        """Read the part and the curves that a case names."""
        own, trim = output.part_mesh, output.trim
        if not (own or output.deck or trim):
            return cls(output)
        if "dxf" in (output.pattern or ()):
            require("a .dxf of the pattern", "dxf", "ezdxf")
        mesh = None if own is None else io.read_tool_mesh(own)
        deck = None if output.deck is None else io.read_part_deck(output.deck)
        of_deck = None if deck is None else deck.mesh
        for file, one in ((own, mesh), (output.deck, of_deck)):
            with errors_about(str(file)):
                refuse_unit_of_part(one)
        export = cls(output, mesh or of_deck, deck)
        if trim is not None:
            files = (trim,) if isinstance(trim, str) else trim
            return replace(export, curves=[io.read_curve(file, 3) for file in files])
        assert export.part is not None
        try:
            return replace(export, curves=export.part.boundary())
        except MeshError as error:
            name = printable(own or output.deck)
            return replace(export, no_curves=f"{name}: {error}")

    @classmethod
    def of_options(
        cls, options: argparse.Namespace, known: Collection[str] = ()
    ) -> "PartExport":
        """Read what options name; ``known`` are keys that the command provides."""
        keys = {
            path.removeprefix("output."): value
            for path, value in vars(options).items()
            if path.startswith("output.")
        }
        try:
            output = converted("output", keys, Output)
            refuse_incomplete({"output": output}, known)
            return cls.read(output)
        except ValueError as error:
            raise ValueError(as_typed(str(error), options)) from None

    def __bool__(self) -> bool:
        """True if there is something to export."""
        return self.part is not None or bool(self.curves)

    @property
    def has_curves(self) -> bool:
        """True if there is a pattern, or a reason why there is none."""
        return bool(self.curves or self.no_curves)

    @property
    def kinds(self) -> Sequence[str]:
        """Kinds of files of the pattern."""
        return self.output.pattern or PATTERN_KINDS

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
        names += [*PATTERN] if self.has_curves else []
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
        output = self.output
        is_requested = {
            "part": self.part is not None,
            "pattern": self.has_curves and (output.pattern or output.trim) is not None,
            "deck": self.deck is not None,
        }
        requested = (what for what, holds in is_requested.items() if holds)
        reasons = {what: str(figures.get(what, "")) for what in requested}
        return [f"{k}: {text}" for k, text in reasons.items() if _NOT in text]

    def _fibres(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        if self.part is None:
            return {}
        fibres = self._on(sheet, self.part)
        for name in _PART:
            io.write_fibres(folder / name, fibres)
        return {
            "part_covered_share_of_elements": float(fibres.covered.mean()),
            "part_reach_mm": self._reach(sheet, self.part),
        }

    def _reach(self, sheet: Sheet, part: ToolMesh) -> float:
        """Largest distance of the part from the ply in mm."""
        return self.output.part_reach_mm or default_reach(sheet, part)

    def _on(self, sheet: Sheet, part: ToolMesh) -> FibresInSpace:
        return fibres_on_tool(sheet, part, reach=self.output.part_reach_mm)

    def _covered(self, sheet: Sheet) -> list[ToolMesh]:
        """Connected pieces of the part on which the ply lies, without other skins."""
        assert self.part is not None
        cells, points = self.part.cells, self.part.points
        covered = self._on(sheet, self.part).covered
        edges = edges_of(cells)[0]
        piece = components(points.shape[1], edges)
        of_element = np.concatenate([piece[cell[0]] for cell in cells])
        return [
            ToolMesh(points, tuple(cell[:, piece[cell[0]] == k] for cell in cells))
            for k in np.unique(of_element[covered])
        ]

    def _with_layers(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        if self.deck is None:
            return {}
        thickness = self.output.thickness_mm
        assert thickness is not None  # see `refuse_incomplete`
        (folder / _DECK).mkdir()
        files = io.write_part_deck(
            *(folder / _DECK, self.deck, self._on(sheet, self.deck.mesh)),
            thickness=thickness,
            material=self.output.material,
            calculix=self.output.calculix,
        )
        written = (file for file in (folder / _DECK).rglob("*") if file.is_file())
        names = sorted(file.relative_to(folder).as_posix() for file in written)
        return {"deck": files[0].relative_to(folder).as_posix(), "deck_files": names}

    def _pattern(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        if self.no_curves:
            raise ValueError(self.no_curves)
        if not self.curves:
            return {}
        if self.output.trim is not None:
            outer, *holes = self.curves
            reach = self.output.part_reach_mm
            patterns = [flat_pattern(sheet, outer, holes=holes, reach=reach)]
        else:
            assert self.part is not None
            reach, patterns = self._reach(sheet, self.part), []
            for piece in self._covered(sheet):
                outer, *holes = sorted(piece.boundary(), key=_extent, reverse=True)
                patterns.append(flat_pattern(sheet, outer, holes=holes, reach=reach))
        write_patterns(folder, patterns, self.kinds)
        return {
            "pattern_area_mm2": sum(pattern.area for pattern in patterns),
            "pattern_length_mm": sum(pattern.length for pattern in patterns),
        }


def _extent(curve: ndarray) -> float:
    """Diagonal of the bounding box of a curve in mm."""
    return float(np.linalg.norm(np.ptp(curve, axis=1)))
