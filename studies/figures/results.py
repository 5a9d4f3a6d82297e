"""Published results of studies: read, put into tables and words, computed again."""

from argparse import ArgumentParser
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..common import machine_and_versions, provenance
from ..study import Row, Study, load
from .pages import ROOT

# Numbers that differ by less are the same, as a share and in the unit of the column.
# Processors and libraries of linear algebra differ by round-off, which equilibria with
# nearly singular tangents amplify; pages show four digits at most.
_SAME, _NOTHING = 1e-4, 1e-7


def folder_of(name: str, study: Study[Any]) -> Path:
    """The folder with the published results of a study."""
    return ROOT / "docs" / (study.folder or name)


def in_words(name: str) -> dict[str, str]:
    """The results of a study in words, and the machine and commit of its last run."""
    study = load(name)
    folder = folder_of(name, study)
    words = study.figures(study.stored(folder))
    for run in provenance.read(folder).get(name, [])[-1:]:
        if "packages" in run:
            words |= {"machine": machine_and_versions.sentence(run)}
    return words


def outdated_tables(name: str) -> dict[Path, str]:
    """The tables that differ from what the stored rows give, with the right text.

    CSV files are among them: cells that are edited by hand seldom stay as written.
    """
    study = load(name)
    folder = folder_of(name, study)
    texts = study.tables(study.stored(folder))
    return {
        folder / file: text
        for file, text in texts.items()
        if _read(folder / file) != text
    }


def differences(name: str) -> list[str]:
    """How the sample of a study, computed again, differs from the stored rows."""
    study = load(name)
    if not study.sample:
        return []
    parser = ArgumentParser()
    study.add_options(parser)
    cases = {study.name(case): case for case in study.cases(parser.parse_args([]))}
    stored = study.stored(folder_of(name, study))
    computed = study.examine(cases[study.sample])
    return [
        f"{name}, {study.sample}: {column} is {value!r}, not {was!r}"
        for row in computed
        for column, value, was in _apart(row, stored, study.volatile)
    ]


def _apart(
    row: Row, stored: Iterable[Row], volatile: tuple[str, ...]
) -> list[tuple[str, Any, Any]]:
    """Columns in which a row differs from the stored row that is nearest to it."""
    steady = {k: v for k, v in row.items() if not any(part in k for part in volatile)}
    return min(
        (
            [(k, v, other.get(k)) for k, v in steady.items() if not _same(v, other, k)]
            for other in stored
        ),
        key=len,
        default=[("rows", len(row), 0)],
    )


def _same(value: Any, other: Row, column: str) -> bool:
    was = other.get(column)
    if isinstance(value, float) and isinstance(was, float | int):
        both_nan = value != value and was != was
        return both_nan or abs(value - was) <= _SAME * abs(was) + _NOTHING
    return bool(value == was) or (value in ("", None) and was in ("", None))


def _read(file: Path) -> str | None:
    return file.read_bytes().decode() if file.is_file() else None
