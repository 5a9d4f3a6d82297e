"""Where a picture goes, checked before it is drawn."""

import os
from pathlib import Path


def picture_path(filename: str | os.PathLike[str], suffix: str = ".png") -> Path:
    """The path of a picture's file.

    Parameters
    ----------
    filename
        Where to write the picture.
    suffix
        The suffix that says what will be in the file; a name without any will do too.

    Raises
    ------
    ValueError
        If the suffix of the name is another.
    FileNotFoundError
        If the folder of the file is not there.
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
