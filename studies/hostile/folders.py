"""What folders hold."""

import os
from pathlib import Path


def folder_content(folder: Path) -> dict[str, bytes]:
    """Bytes of every file by name; target of every link, mode of everything else."""
    content = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            content[name] = f"link to {os.readlink(path)}".encode()
        elif path.is_file():
            content[name] = path.read_bytes()
        else:
            content[name] = f"mode {path.lstat().st_mode}".encode()
    return content


def visible_files(folder: Path) -> dict[str, bytes]:
    """Bytes of files by name, without hidden ones: those are not complete yet."""
    return {
        name: content
        for name, content in folder_content(folder).items()
        if "/." not in f"/{name}" and (folder / name).is_file()
    }


def write_folder(content: dict[str, bytes], folder: Path) -> Path:
    """Write files into a new folder."""
    folder.mkdir()
    for name, of_file in content.items():
        (folder / name).write_bytes(of_file)
    return folder
