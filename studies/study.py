"""The protocol of all studies: cases, the rows of each case, tables and results.

A study is a folder at any depth with a module `study` that defines ``STUDY``.  Its name
is the folder's, and the first line of the folder's docstring is its description.
"""

import argparse
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeAlias, TypeVar

from .common.tables import rows_of_csv

Case = TypeVar("Case")

#: A result, ready for JSON: numbers, text, lists and dicts.
Row: TypeAlias = dict[str, Any]


class Study(Generic[Case]):
    """A study, which ``python -m studies NAME --out DIR`` runs.

    A subclass defines `cases`, `examine`, `line` and `tables`, and other methods if it
    needs them.  With more than one worker the study and its cases must be picklable.

    Attributes
    ----------
    files, pictures
        Names of the files that `tables` and `draw` may write.  The first file that
        ends with ``.csv`` contains the rows, unless `stored` is overridden.
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

    files: ClassVar[tuple[str, ...]] = ()
    pictures: ClassVar[tuple[str, ...]] = ()
    timed: ClassVar[bool] = False
    folder: ClassVar[str] = ""
    sample: ClassVar[str] = ""
    volatile: ClassVar[tuple[str, ...]] = ("second", "time")

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add further command-line options; by default none."""

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        """The cases, in the order of the report."""
        raise NotImplementedError

    def name(self, case: Case) -> str:
        """A name that no other case has, and that is the same in every run."""
        return str(case)

    def examine(self, case: Case) -> list[Row]:
        """Run one case and return its rows, which are kept on file for ``--resume``."""
        raise NotImplementedError

    def line(self, rows: list[Row]) -> str:
        """Text for the rows of one case, in one line or more."""
        raise NotImplementedError

    def tables(self, rows: list[Row]) -> dict[str, str]:
        """The text of each file by its name, a function of the rows alone.

        The rows may come from some cases only.
        """
        raise NotImplementedError

    def stored(self, folder: Path) -> list[Row]:
        """The rows that a run wrote into a folder; every row has all columns.

        Raises
        ------
        FileNotFoundError
            If the folder has no results.
        """
        data = next(name for name in self.files if name.endswith(".csv"))
        return rows_of_csv((folder / data).read_text(encoding="utf-8"))

    def figures(self, rows: list[Row]) -> dict[str, str]:
        """Results for prose by name, in words and with their units; by default none."""
        return {}

    def draw(self, rows: list[Row], folder: Path) -> None:
        """Draw `pictures` into a folder; by default none."""

    def complaint(self, rows: list[Row]) -> str:
        """Why the study fails, with exit code 1, on one line; empty if it does not."""
        return ""

    def written(self, cases: Sequence[Case]) -> Sequence[str]:
        """Names of the files that a run of these cases replaces."""
        return *self.files, *self.pictures


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
