"""Protocol of studies: cases, rows of results, tables and figures.

A study is a package at any depth with a module `study` that defines ``STUDY``.  The
package gives its name; the first line of the package's docstring is its description.
"""

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeAlias, TypeVar

from .common.tables import Row, cell, csv_table, json_text, rows_of_csv

Case = TypeVar("Case")

#: Text of a table as a function of rows; empty if the rows lack its cases.
Table: TypeAlias = Callable[[list[Row]], str]

#: Draws rows to a figure file.
Picture: TypeAlias = Callable[[list[Row], Path], object]


@dataclass(frozen=True)
class Part:
    """A file of rows, with the tables and figures made from them.

    Attributes
    ----------
    data
        File name: CSV, or JSON with a list of rows, or with one row if the part has one
        case.
    tables, pictures
        Tables and figures by file name.
    cases
        Patterns of case names; ``*`` matches any characters.
    """

    data: str
    tables: Mapping[str, Table] = field(default_factory=dict)
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    cases: tuple[str, ...] = ("*",)

    def has(self, name: str) -> bool:
        """Return True if a case of this name belongs to the part."""
        return any(fnmatchcase(name, pattern) for pattern in self.cases)

    def of(self, rows: Sequence[Row]) -> list[Row]:
        """The rows of the part."""
        return [row for row in rows if self.has(row.get("case", ""))]

    def texts(self, rows: list[Row]) -> dict[str, str]:
        """The rows and their tables, by file name."""
        texts = {name: text for name, of in self.tables.items() if (text := of(rows))}
        return {self.data: self._written(rows), **texts}

    def _written(self, rows: list[Row]) -> str:
        if self.data.endswith(".csv"):
            return csv_table(rows)
        if self.cases != (rows[0].get("case"),):
            return json_text(rows)
        return json_text({k: x for k, x in rows[0].items() if k != "case"})

    def read(self, folder: Path) -> list[Row]:
        """Read the rows from a folder; empty if the file is missing."""
        file = folder / self.data
        if not file.is_file():
            return []
        text = file.read_text(encoding="utf-8")
        if self.data.endswith(".csv"):
            return rows_of_csv(text)
        data: list[Row] | Row = json.loads(text)
        return data if isinstance(data, list) else [{"case": self.cases[0], **data}]


class Study(Generic[Case]):
    """A study, run by ``python -m studies NAME --out DIR``.

    A subclass defines `parts` and `cases`, and `examine` unless its cases have a method
    ``rows``.  With several workers, the study and its cases must be picklable.

    Attributes
    ----------
    parts
        Files that the study writes.
    shown
        Format of a row for the log line; by default all entries.  The entry ``refused``
        of a row, if not empty, is printed instead.
    timed
        True if cases are timed.  Timed cases run one at a time, on one thread.
    folder
        Folder of the published results below ``docs``; empty for the name of the study.
    sample
        Name of a case of a few seconds, which ``python -m studies figures --check``
        recomputes; empty for none.
    volatile
        Substrings of the names of columns that vary between runs, such as times.
    """

    parts: ClassVar[tuple[Part, ...]] = ()
    shown: ClassVar[str] = ""
    timed: ClassVar[bool] = False
    folder: ClassVar[str] = ""
    sample: ClassVar[str] = ""
    volatile: ClassVar[tuple[str, ...]] = ("second", "time")

    @property
    def files(self) -> Sequence[str]:
        """Names of the files written by `tables`."""
        return [name for part in self.parts for name in (part.data, *part.tables)]

    @property
    def pictures(self) -> Sequence[str]:
        """Names of the files written by `draw`."""
        return [name for part in self.parts for name in part.pictures]

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add command-line options; by default none."""

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        """The cases in report order."""
        raise NotImplementedError

    def name(self, case: Case) -> str:
        """A unique name of a case, the same in every run."""
        return str(case)

    def examine(self, case: Any) -> list[Row]:
        """Run one case and return its rows, which are saved for ``--resume``."""
        rows: list[Row] = case.rows()
        return rows

    def line(self, rows: list[Row]) -> str:
        """Log text for the rows of one case, of one or more lines."""
        texts = (row.get("refused") or self._shown(row) for row in rows)
        return f"{rows[0]['case']}: {', '.join(map(str, texts))}"

    def _shown(self, row: Row) -> object:
        if self.shown:
            return cell(row, self.shown)
        known = {k: x for k, x in row.items() if k != "case" and x is not None}
        return ", ".join(
            f"{k} {x:.3g}" if isinstance(x, float) else f"{k} {x}"
            for k, x in known.items()
        )

    def tables(self, rows: list[Row]) -> dict[str, str]:
        """The text of each file by its name, as a function of the rows only.

        The rows may be from a subset of the cases.
        """
        texts: dict[str, str] = {}
        for part in self.parts:
            if part_rows := part.of(rows):
                texts |= part.texts(part_rows)
        return texts

    def stored(self, folder: Path) -> list[Row]:
        """The rows that a run wrote to a folder, with all columns of their file.

        Raises
        ------
        FileNotFoundError
            If the folder contains no results.
        """
        rows = [row for part in self.parts for row in part.read(folder)]
        if not rows:
            raise FileNotFoundError(f"{folder} contains no results")
        return rows

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Results for prose by name, formatted with units; by default none."""
        return {}

    def draw(self, rows: list[Row], folder: Path) -> None:
        """Draw the figures of the rows into a folder."""
        for part in self.parts:
            if part_rows := part.of(rows):
                for name, draw in part.pictures.items():
                    draw(part_rows, folder / name)

    def complaint(self, rows: list[Row]) -> str:
        """One-line failure message, for exit code 1; empty if the study passes."""
        return ""

    def written(self, cases: Sequence[Case]) -> Sequence[str]:
        """Names of the files replaced by a run of these cases."""
        names = [self.name(case) for case in cases]
        return [
            file
            for part in self.parts
            if any(map(part.has, names))
            for file in (part.data, *part.tables, *part.pictures)
        ]


def descriptions() -> dict[str, str]:
    """Descriptions of the studies by name; imports no study module."""
    modules = sorted(_modules().items())
    documented = ((name, import_module(module).__doc__) for name, module in modules)
    return {
        name: (text or "").partition("\n")[0].rstrip(".") for name, text in documented
    }


def load(name: str) -> Study[Any]:
    """Load the study of this name with its dependencies."""
    study = import_module(f"{_modules()[name]}.study").STUDY
    assert isinstance(study, Study)
    return study


def _modules() -> dict[str, str]:
    """Module of each study by name."""
    root = Path(__file__).parent
    folders = (file.parent.relative_to(root) for file in root.glob("*/**/study.py"))
    return {folder.name: ".".join(("studies", *folder.parts)) for folder in folders}
