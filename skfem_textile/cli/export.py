"""Fibres in the part and flat patterns, of a run or of a finished one."""

import argparse
import filecmp
import json
import shutil
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from glob import escape
from pathlib import Path, PurePosixPath
from typing import Any, ClassVar

import numpy as np
from numpy import ndarray

from .. import io
from ..cases.build import refuse_incomplete
from ..cases.read import converted
from ..cases.schema import PATTERN_KINDS, Output
from ..io.file_numbers import errors_about
from ..mesh.checks import MeshError
from ..mesh.extents import diagonal_of
from ..mesh.graph import components, edges_of
from ..mesh.requirements import is_installed, lacks, require
from ..mesh.user_input import printable
from ..nets.flat_pattern import FlatPattern, flat_pattern, outlined, with_holes
from ..nets.sheet import FibresInSpace, Sheet, default_reach, fibres_on_tool
from ..solve.quantities import Quantity, first_rows
from ..surfaces.tool_mesh import ToolMesh
from .extents import trimming_curves, warn_of_curves, warn_of_part
from .interruption import held
from .output import STOPPED_EARLY, complain, say
from .page import say_rows
from .result_folder import ResultFolder
from .run_options import typed

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
    Quantity("Deck for CalculiX", "calculix"),
    Quantity(
        *("Part covered", "part_covered_share_of_elements", "%"),
        note=" of its elements",
    ),
    Quantity("Flat pattern", "pattern"),
    Quantity("Flat pattern", "pattern_area_mm2", "mm²"),
)


def run(options: argparse.Namespace) -> int:
    """Export the ply of a finished run into its folder; returns the exit code.

    Files of earlier exports stay, except the files that this export writes, and files
    of the same deck that it no longer writes.

    Raises
    ------
    ValueError
        If there is nothing to export, or a file is refused.
    OSError, OutputError
        If the folder cannot be written.
    """
    from ..cases.finished import read_result

    export = PartExport.of_options(options)
    if not export:
        raise ValueError("nothing to export: specify --part-mesh, --deck or --trim")
    if export.output.trim is None and export.output.pattern is None:
        export = replace(export, curves=(), no_curves="")
    finished = read_result(options.folder)
    if finished.case.scene.dimension == 2:
        raise ValueError(
            f"the ply in {printable(options.folder)} is in its plane: exports require "
            "tools"
        )
    what = "" if finished.summary.get("converged") else "the run stopped early"
    export.refuse_folder(options.folder)
    decks = _decks(finished.summary)
    own = decks.pop(export.copy, [])
    others = {name: options.folder / name for names in decks.values() for name in names}
    export = replace(export, others=others)
    old = [escape(name) for name in own if name not in others]
    files = (name for names in export.names.values() for name in names)
    out = ResultFolder(options.folder, ("summary.json", *files, *old))
    with held(), out as folder:
        figures = export.write(finished.sheet(), what, folder)
        out.stale = old if "deck_files" in figures else ()
        figures |= export.earlier(figures, options.folder)
        summary = export.added(finished.summary, figures)
        io.write_summary(summary, folder / "summary.json")
    say_rows(first_rows({**figures, "first": [one.declared() for one in _FIRST]}))
    say(f"results written to {printable(options.folder)}{out.removed_text()}")
    if missing := export.missing(figures):
        complain("; ".join(missing))
        return STOPPED_EARLY
    return 0


def decks_in(folder: Path) -> tuple[str, ...]:
    """Glob patterns of the files of decks that exports wrote into a folder."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        decks = _decks(summary)
    except (OSError, ValueError, AttributeError, TypeError):
        return ()
    return tuple({escape(name): None for names in decks.values() for name in names})


def _decks(summary: Mapping[str, Any]) -> dict[str, list[str]]:
    """Files of each deck in a summary: below the folder of decks, and no others."""
    listed = summary.get("deck_files")
    if not isinstance(listed, Mapping):
        return {}
    return {
        deck: [name for name in map(str, names) if _is_below(PurePosixPath(name))]
        for deck, names in listed.items()
        if isinstance(names, list)
    }


def _is_below(path: PurePosixPath) -> bool:
    """True for a path below the folder of decks."""
    return path.parts[:1] == (_DECK,) and ".." not in path.parts


def _remove(path: Path) -> None:
    """Remove a file or folder of an export that was not completed."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


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
    there are none. ``others`` are the files of other decks in the folder, by the names
    of files that `write` may write.
    """

    output: Output
    part: ToolMesh | None = None
    deck: "io.PartDeck | None" = None
    curves: Sequence[ndarray] = ()
    no_curves: str = ""
    others: Mapping[str, Path] = field(default_factory=dict)
    all_files: ClassVar[tuple[str, ...]] = (*_PART, *PATTERN)

    @classmethod
    def read(cls, output: Output) -> "PartExport":
        """Read the part and the curves that a case names."""
        own, trim = output.part_mesh, output.trim
        if "dxf" in (output.pattern or ()):
            require("a .dxf of the pattern", "dxf", "ezdxf")
        if not (own or output.deck or trim):
            return cls(output)
        from ..io.tools import refuse_unit_of_part

        mesh = None if own is None else io.read_tool_mesh(own)
        deck = None if output.deck is None else io.read_part_deck(output.deck)
        of_deck = None if deck is None else deck.mesh
        for file, one in ((own, mesh), (output.deck, of_deck)):
            with errors_about(str(file)):
                refuse_unit_of_part(one)
        export = cls(output, mesh or of_deck, deck)
        if trim is not None:
            return replace(export, curves=trimming_curves(export.trim))
        assert export.part is not None
        try:
            return replace(export, curves=export.part.boundary())
        except MeshError as error:
            return replace(export, no_curves=f"{export.named}: {error}")

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
        with typed(options):
            output = converted("output", keys, Output)
            refuse_incomplete({"output": output}, known)
            return cls.read(output)

    def __bool__(self) -> bool:
        """True if there is something to export."""
        return self.part is not None or bool(self.curves)

    @property
    def has_curves(self) -> bool:
        """True if there is a pattern, or a reason why there is none."""
        return bool(self.curves or self.no_curves)

    @property
    def trim(self) -> Sequence[str]:
        """Files of the trimming curves."""
        trim = self.output.trim or ()
        return (trim,) if isinstance(trim, str) else trim

    @property
    def kinds(self) -> Sequence[str]:
        """Kinds of files of the pattern."""
        return self.output.pattern or PATTERN_KINDS

    def refuse_folder(self, out: Path) -> None:
        """Refuse files of a deck that its copy would replace."""
        for file in self.deck.files if self.deck else ():
            if (out / _DECK).resolve() in file.resolve().parents:
                raise ValueError(
                    f"{printable(file)}: the copy of the deck is written into this "
                    "folder: move the file"
                )

    @property
    def named(self) -> str:
        """File of the part."""
        return printable(self.output.part_mesh or self.output.deck)

    @property
    def copy(self) -> str:
        """Name of the copy of the deck; empty if there is none."""
        return f"{_DECK}/{self.deck.path.name}" if self.deck else ""

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """Glob patterns of the files of each kind of export."""
        names = {"part": _PART, "deck": (escape(self.copy),), "pattern": PATTERN}
        given = {"part": self.part, "deck": self.deck, "pattern": self.has_curves}
        return {kind: files for kind, files in names.items() if given[kind]}

    def write(self, sheet: Sheet, reason: str, folder: Path) -> dict[str, Any]:
        """Write the exports; returns figures, and the reason for each missing export.

        The sheet is in the axes of the part.  ``reason`` says why there is no export
        from it; empty if there is one.
        """
        if self.part is not None:
            file = self.output.part_mesh or self.output.deck
            warn_of_part(str(file), self.part.points, sheet.positions)
        if self.output.trim is not None:
            warn_of_curves(self.trim, self.curves, sheet.positions)
        figures: dict[str, Any] = {}
        writers: dict[str, Callable[[Sheet, Path], dict[str, Any]]] = {
            "part": self._fibres,
            "deck": self._with_layers,
            "pattern": self._pattern,
        }
        for kind, names in self.names.items():
            try:
                if reason:
                    raise ValueError(reason)
                figures |= writers[kind](sheet, folder)
            except ValueError as error:
                figures[kind] = f"{_NOT}: {error}"
                for name in (_DECK,) if kind == "deck" else names:
                    _remove(folder / name)
        return figures

    def earlier(self, figures: Mapping[str, Any], out: Path) -> dict[str, str]:
        """Reasons for missing exports of which a folder has files of earlier ones."""
        return {
            kind: f"{figures[kind]}; the files of an earlier export stay"
            for kind, names in self.names.items()
            if _NOT in str(figures.get(kind, ""))
            and any(any(out.glob(name)) for name in names)
        }

    @staticmethod
    def added(summary: Mapping[str, Any], figures: Mapping[str, Any]) -> dict[str, Any]:
        """Summary of a run with the figures of `write`, which are printed too."""
        own = [quantity.declared() for quantity in _FIRST]
        first = [one for one in summary["first"] if one not in own]
        decks = _decks(summary) | figures.get("deck_files", {})
        kinds = ("part", "deck", "pattern")
        again = [k for k in kinds if any(name.startswith(k) for name in figures)]
        again += ["calculix"] if "deck" in again else []
        kept = {k: x for k, x in summary.items() if k not in again}
        return {
            **kept,
            **figures,
            **({"deck_files": decks} if decks else {}),
            "first": [*first, *(own if figures else ())],
        }

    def missing(self, figures: Mapping[str, Any]) -> list[str]:
        """Requested exports that `write` has not written, with reasons."""
        output = self.output
        is_requested = {
            "part": self.part is not None,
            "pattern": self.has_curves and (output.pattern or output.trim) is not None,
            "deck": self.deck is not None,
            "calculix": output.calculix,
        }
        requested = (what for what, holds in is_requested.items() if holds)
        reasons = {what: str(figures.get(what, "")) for what in requested}
        return [f"{k}: {text}" for k, text in reasons.items() if _NOT in text]

    def _fibres(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        assert self.part is not None  # see `names`
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
        assert self.deck is not None  # see `names`
        thickness = self.output.thickness_mm
        assert thickness is not None  # see `refuse_incomplete`
        from ..io.part_decks import written_part_deck

        _, no_calculix = written_part_deck(
            *(folder / _DECK, self.deck, self._on(sheet, self.deck.mesh)),
            *(thickness, self.output.material, self.output.calculix),
        )
        written = (file for file in (folder / _DECK).rglob("*") if file.is_file())
        names = sorted(file.relative_to(folder).as_posix() for file in written)
        for name in filter(self.others.__contains__, names):
            other = self.others[name]
            if other.is_file() and not filecmp.cmp(folder / name, other, shallow=False):
                raise ValueError(
                    f"{printable(name)} would replace a file of another deck in this "
                    "folder: move that deck, or rename the file"
                )
        of_calculix = {"calculix": f"{_NOT}: {no_calculix}"} if no_calculix else {}
        return {"deck": self.copy, "deck_files": {self.copy: names}, **of_calculix}

    def _pattern(self, sheet: Sheet, folder: Path) -> dict[str, Any]:
        if self.no_curves:
            raise ValueError(self.no_curves)
        trim, reach = self.output.trim, self.output.part_reach_mm
        if trim is not None:
            found = []
            files = (trim,) if isinstance(trim, str) else trim
            for file, curve in zip(files, self.curves, strict=True):
                with errors_about(file):
                    found.append(outlined(sheet, curve, reach=reach))
            patterns = [with_holes(sheet, found[0], tuple(found[1:]))]
        else:
            assert self.part is not None
            reach, patterns = self._reach(sheet, self.part), []
            with errors_about(f"boundary of the part {self.named}"):
                for piece in self._covered(sheet):
                    outer, *holes = sorted(
                        piece.boundary(), key=diagonal_of, reverse=True
                    )
                    patterns.append(flat_pattern(sheet, outer, None, holes, reach))
        write_patterns(folder, patterns, self.kinds)
        return {
            "pattern_area_mm2": sum(pattern.area for pattern in patterns),
            "pattern_length_mm": sum(pattern.length for pattern in patterns),
        }
