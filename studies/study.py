"""The protocol of all studies: cases, one case examined, tables and figures of rows.

A study is a subfolder with a module `study` that defines ``STUDY``.  The first line of
the subfolder's docstring is its description.
"""

import argparse
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeAlias, TypeVar

Case = TypeVar("Case")

#: A result, ready for JSON: numbers, text, lists and dicts.
Row: TypeAlias = dict[str, Any]


class Study(Generic[Case]):
    """What is run by ``python -m studies NAME --out DIR``.

    A subclass defines `cases`, `examine` and `tables`, and the rest where it needs it.
    With more than one worker a case, and the study itself, must be picklable.

    Attributes
    ----------
    files, pictures
        Names of the files that `tables` and `draw` may write.
    timed
        Whether cases are timed: then they run one at a time, on one thread.
    """

    files: ClassVar[tuple[str, ...]] = ()
    pictures: ClassVar[tuple[str, ...]] = ()
    timed: ClassVar[bool] = False

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add command-line options of the study's own; there are none."""

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        """The cases, in the order of the report."""
        raise NotImplementedError

    def name(self, case: Case) -> str:
        """A name that no other case has, the same in every run."""
        return str(case)

    def examine(self, case: Case) -> list[Row]:
        """Run one case; what it returns is kept on file for ``--resume``."""
        raise NotImplementedError

    def line(self, rows: list[Row]) -> str:
        """Tell the rows of one case on one line, or on some."""
        raise NotImplementedError

    def tables(self, rows: list[Row]) -> dict[str, str]:
        """The text of each file by its name; rows may be those of some cases only."""
        raise NotImplementedError

    def draw(self, rows: list[Row], folder: Path) -> None:
        """Draw `pictures` into a folder; there are none."""

    def complaint(self, rows: list[Row]) -> str:
        """What makes the study fail, with exit code 1, on one line; or nothing."""
        return ""

    def written(self, cases: Sequence[Case]) -> Sequence[str]:
        """Names of the files that a run of these cases replaces."""
        return *self.files, *self.pictures


def descriptions() -> dict[str, str]:
    """What each study tells, by its name; loads nothing that studies need."""
    here = Path(__file__).parent
    names = sorted(file.parent.name for file in here.glob("*/study.py"))
    documented = ((name, import_module(f"studies.{name}").__doc__) for name in names)
    return {
        name: (text or "").partition("\n")[0].rstrip(".") for name, text in documented
    }


def load(name: str) -> Study[Any]:
    """The study of a name, with what it needs."""
    study = import_module(f"studies.{name}.study").STUDY
    assert isinstance(study, Study)
    return study
