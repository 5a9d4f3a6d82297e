"""The protocol of all studies: cases, the rows of each case, tables and results.

A study is a folder at any depth with a module `study` that defines ``STUDY``.  Its name
is the folder's, and the first line of the folder's docstring is its description.
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

#: The text of a table, a function of rows; empty if the rows do not have its cases.
Table: TypeAlias = Callable[[list[Row]], str]

#: Draws a picture of rows into a file.
Picture: TypeAlias = Callable[[list[Row], Path], object]


@dataclass(frozen=True)
class Part:
    """A file of rows, with the tables and pictures that are made of them.

    Attributes
    ----------
    data
        Name of the file: CSV, or JSON with a list of rows, or with the row of the only
        case of the part.
    tables, pictures
        Tables and pictures by the names of their files.
    cases
        Patterns of the names of the cases; ``*`` stands for any characters.
    """

    data: str
    tables: Mapping[str, Table] = field(default_factory=dict)
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    cases: tuple[str, ...] = ("*",)

    def has(self, name: str) -> bool:
        """Whether a case of this name belongs to the part."""
        return any(fnmatchcase(name, pattern) for pattern in self.cases)

    def of(self, rows: Sequence[Row]) -> list[Row]:
        """The rows of the part."""
        return [row for row in rows if self.has(row.get("case", ""))]

    def texts(self, rows: list[Row]) -> dict[str, str]:
        """The rows and the tables that they give, by the names of the files."""
        texts = {name: text for name, of in self.tables.items() if (text := of(rows))}
        return {self.data: self._written(rows), **texts}

    def _written(self, rows: list[Row]) -> str:
        if self.data.endswith(".csv"):
            return csv_table(rows)
        if self.cases != (rows[0].get("case"),):
            return json_text(rows)
        return json_text({k: x for k, x in rows[0].items() if k != "case"})

    def read(self, folder: Path) -> list[Row]:
        """The rows of the file in a folder; none if there is no file."""
        file = folder / self.data
        if not file.is_file():
            return []
        text = file.read_text(encoding="utf-8")
        if self.data.endswith(".csv"):
            return rows_of_csv(text)
        found: list[Row] | Row = json.loads(text)
        return found if isinstance(found, list) else [{"case": self.cases[0], **found}]


class Study(Generic[Case]):
    """A study, which ``python -m studies NAME --out DIR`` runs.

    A subclass defines `parts` and `cases`, and `examine` unless its cases have a method
    ``rows``.  With more than one worker the study and its cases must be picklable.

    Attributes
    ----------
    parts
        The files that the study writes.
    shown
        A format of the entries of a row, for the line that reports it; all of them
        without it.  A row that has something under ``refused`` is reported with that.
    timed
        Whether cases are timed.  Timed cases run one at a time, on one thread.
    folder
        Folder of the published results below ``docs``; empty if it has the name of the
        study.
    sample
        Name of a case of a few seconds, which ``python -m studies figures --check``
        computes again; empty if there is none.
    volatile
        Parts of the names of columns that differ from run to run, such as times.
    """

    parts: ClassVar[tuple[Part, ...]] = ()
    shown: ClassVar[str] = ""
    timed: ClassVar[bool] = False
    folder: ClassVar[str] = ""
    sample: ClassVar[str] = ""
    volatile: ClassVar[tuple[str, ...]] = ("second", "time")

    @property
    def files(self) -> Sequence[str]:
        """Names of the files that `tables` may write."""
        return [name for part in self.parts for name in (part.data, *part.tables)]

    @property
    def pictures(self) -> Sequence[str]:
        """Names of the files that `draw` may write."""
        return [name for part in self.parts for name in part.pictures]

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add further command-line options; by default none."""

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        """The cases, in the order of the report."""
        raise NotImplementedError

    def name(self, case: Case) -> str:
        """A name that no other case has, and that is the same in every run."""
        return str(case)

    def examine(self, case: Any) -> list[Row]:
        """Run one case and return its rows, which are kept on file for ``--resume``."""
        rows: list[Row] = case.rows()
        return rows

    def line(self, rows: list[Row]) -> str:
        """Text for the rows of one case, in one line or more."""
        shown = (row.get("refused") or self._shown(row) for row in rows)
        return f"{rows[0]['case']}: {', '.join(map(str, shown))}"

    def _shown(self, row: Row) -> object:
        if self.shown:
            return cell(row, self.shown)
        known = {k: x for k, x in row.items() if k != "case" and x is not None}
        return ", ".join(
            f"{k} {x:.3g}" if isinstance(x, float) else f"{k} {x}"
            for k, x in known.items()
        )

    def tables(self, rows: list[Row]) -> dict[str, str]:
        """The text of each file by its name, a function of the rows alone.

        The rows may come from some cases only.
        """
        texts: dict[str, str] = {}
        for part in self.parts:
            if own := part.of(rows):
                texts |= part.texts(own)
        return texts

    def stored(self, folder: Path) -> list[Row]:
        """The rows that a run wrote into a folder; each has all columns of its file.

        Raises
        ------
        FileNotFoundError
            If the folder has no results.
        """
        rows = [row for part in self.parts for row in part.read(folder)]
        if not rows:
            raise FileNotFoundError(f"{folder} has no results")
        return rows

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Results for prose by name, in words and with their units; by default none."""
        return {}

    def draw(self, rows: list[Row], folder: Path) -> None:
        """Draw the pictures of the rows into a folder."""
        for part in self.parts:
            if own := part.of(rows):
                for name, draw in part.pictures.items():
                    draw(own, folder / name)

    def complaint(self, rows: list[Row]) -> str:
        """Why the study fails, with exit code 1, on one line; empty if it does not."""
        return ""

    def written(self, cases: Sequence[Case]) -> Sequence[str]:
        """Names of the files that a run of these cases replaces."""
        names = [self.name(case) for case in cases]
        return [
            file
            for part in self.parts
            if any(map(part.has, names))
            for file in (part.data, *part.tables, *part.pictures)
        ]


def descriptions() -> dict[str, str]:
    """The description of each study by its name; loads nothing that studies need."""
    modules = sorted(_modules().items())
    documented = ((name, import_module(module).__doc__) for name, module in modules)
    return {
        name: (text or "").partition("\n")[0].rstrip(".") for name, text in documented
    }


def load(name: str) -> Study[Any]:
    """Load the study of this name, and all that it needs."""
    study = import_module(f"{_modules()[name]}.study").STUDY
    assert isinstance(study, Study)
    return study


def _modules() -> dict[str, str]:
    """The module of each study by its name."""
    here = Path(__file__).parent
    folders = (file.parent.relative_to(here) for file in here.glob("*/**/study.py"))
    return {folder.name: ".".join(("studies", *folder.parts)) for folder in folders}
