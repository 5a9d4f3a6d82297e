"""Paths of pictures, checked before drawing."""

import os
from pathlib import Path


def picture_path(filename: str | os.PathLike[str], suffix: str = ".png") -> Path:
    """The path of a picture's file.

    Parameters
    ----------
    filename
        Where to write the picture.
    suffix
        Suffix of the format; a name without a suffix is accepted too.

    Raises
    ------
    ValueError
        If the name has another suffix.
    FileNotFoundError
        If the folder of the file does not exist.
    """
    path = Path(filename)
    if path.suffix.lower() not in ("", suffix):
        raise ValueError(
            f"{path}: cannot write {path.suffix} files, only {suffix}: name it "
            f"{path.stem}{suffix}"
        )
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {path.parent}")
    return path
