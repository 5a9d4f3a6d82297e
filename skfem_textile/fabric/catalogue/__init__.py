"""Fabrics with their sources: files of laws, specimens and assumptions.

`python -m studies catalogue` writes the files.
"""

import os
from pathlib import Path

from ...mesh.user_input import printable

_FOLDER = Path(__file__).parent


def catalogue() -> tuple[str, ...]:
    """Names of the fabrics of the catalogue, for `read_fabric` and case files.

    Examples
    --------
    >>> "cao2008-plain-weave" in catalogue()
    True
    """
    return tuple(sorted(file.stem for file in _FOLDER.glob("*.json")))


def file_of(name: str | os.PathLike[str]) -> Path:
    """File of a fabric of the catalogue, or the path if it has a suffix.

    Raises
    ------
    ValueError
        If a name without a suffix is not one of the catalogue.
    """
    path = Path(name)
    if path.suffix:
        return path
    if str(name) in catalogue():
        return _FOLDER / f"{name}.json"
    raise ValueError(
        f"{printable(name)} is neither a file of a fabric nor a name in the catalogue: "
        f"{', '.join(catalogue())}"
    )
