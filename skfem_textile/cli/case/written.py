"""The case of a run, written beside its results with all that it reads."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .text import Place

#: The first line of a case file that a run has written.
WRITTEN = "# The case of this folder, with every default, written by skfem-textile."

#: Name of the case file, and of the folder of the files that it names.
CASE, FILES = "case.toml", "case_files"

# Files of meshes, and their kinds that name no other file.
_MESHES = ("mesh", "tool", "part_mesh")
_WHOLE = (".msh", ".inp", ".vtu", ".vtk", ".stl", ".obj", ".ply", ".off")

#: What `WrittenCase.write` may write.
WRITTEN_FILES = (
    CASE,
    *(f"{FILES}/*_law{kind}" for kind in (".csv", ".json")),
    *(f"{FILES}/{key}{kind}" for key in _MESHES for kind in _WHOLE),
    *(f"{FILES}/fabric{kind}" for kind in (".json", ".inp", ".rad")),
    *(f"{FILES}/directions{kind}" for kind in (".vtu", ".csv", ".inp")),
    *(f"{FILES}/{key}.csv" for key in ("test_curve", "trim")),
)


class WrittenCase:
    """The case of a run as it is at the start, to be written at the end.

    Parameters
    ----------
    text
        The text of the case for a first line and what stands for names of files, as
        `case_text` makes it.

    Raises
    ------
    OSError
        If a file that it names cannot be read.
    """

    def __init__(self, text: "Callable[[str, Place], str]") -> None:
        self._files: dict[str, bytes] = {}
        self.text = text(WRITTEN, self._keep)

    def write(self, folder: Path) -> None:
        """Write ``case.toml`` and the files that it names into a folder."""
        (folder / CASE).write_text(self.text, encoding="utf-8")
        for name, content in self._files.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(content)

    def _keep(self, key: str, name: str) -> str:
        """Keep the content of a file; returns its name beside the results."""
        suffix = Path(name).suffix.lower()
        if key in _MESHES and suffix not in _WHOLE:
            return os.path.abspath(name)
        kept = f"{FILES}/{key}{suffix}"
        self._files[kept] = Path(name).read_bytes()
        return kept


def refuse_foreign_case(folder: Path) -> None:
    """Refuse a folder with a case file that no run has written.

    Raises
    ------
    ValueError
        If there is one.
    """
    file = folder / CASE
    if not file.is_file():
        return
    with open(file, "rb") as opened:
        start = opened.read(len(WRITTEN.encode()))
    if start != WRITTEN.encode():
        raise ValueError(
            f"{file} was not written by a run, which would replace it: choose another "
            "folder for --out"
        )
