"""Cases from files and from plain values, for Python."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...scenes import SCENES
from ...scenes.case import Case
from .build import case_of
from .file import CaseFileError, in_file_words, read_case_file, values_of
from .options import tables_of


def case_from_file(path: str | os.PathLike[str]) -> Case:
    """The case of a file.

    Parameters
    ----------
    path
        A case file, in TOML.

    Raises
    ------
    CaseFileError
        If it is no such file; one line says what is wrong with which key.
    OSError
        If it cannot be read.
    """
    path = Path(path)
    return _built(read_case_file(path, _tables()), f"{path}: ")


def case_from_tables(
    tables: Mapping[str, Any], folder: str | os.PathLike[str] = "."
) -> Case:
    """The case that tables describe, with the keys and values of a case file.

    Parameters
    ----------
    tables
        What a case file has, as dictionaries, lists, strings and numbers.  Functions,
        which no file can hold, are refused: `Case` takes them.
    folder
        From which the names of files are taken.

    Raises
    ------
    CaseFileError
        If they describe no case.

    Examples
    --------
    >>> case = case_from_tables({"scene": {"name": "strip"}, "stepping": {"steps": 3}})
    >>> case.steps, case.scene.mesh.nelements
    (3, 150)
    >>> case_from_tables({"scene": {"name": "strip"}, "stepping": {"steps": max}})
    Traceback (most recent call last):
    skfem_textile.cli.case.file.CaseFileError: stepping.steps is a function, ...
    """
    try:
        values = values_of(tables, Path(folder), _tables())
    except ValueError as error:
        raise CaseFileError(str(error)) from None
    return _built(values)


def _tables() -> dict[str, Any]:
    return {name: tables_of(scene) for name, scene in SCENES.items()}


def _built(values: Mapping[str, Any], where: str = "") -> Case:
    try:
        return case_of(values)[0]
    except ValueError as error:
        said = in_file_words(str(error), _tables()[values["scene"]])
        raise CaseFileError(f"{where}{said}") from None
