"""Self-contained HTML pages of results."""

from base64 import b64encode
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from .. import __version__
from ..mesh.user_input import printable
from .output import say

#: Row of a table: name, CSS class or empty, and value.
Row: TypeAlias = tuple[str, str, Any]

# Media types of embedded files by suffix.
_MEDIA = {
    ".png": "image/png",
    ".gif": "image/gif",
    ".svg": "image/svg+xml",
    ".csv": "text/csv",
}


def write_page(folder: Path, name: str, template: str, **content: Any) -> None:
    """Write a page from a template of this package, without external references."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(__package__, ""),
        autoescape=True,
        trim_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["shown"] = formatted
    text = environment.get_template(template).render(version=__version__, **content)
    (folder / name).write_text(text, encoding="utf-8")


def formatted(value: Any) -> str:
    """Format a value in one line, numbers with six digits."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return "" if value is None else printable(value)


def say_rows(verdict: Iterable[Row]) -> None:
    """Print rows of a verdict."""
    for name, _, text in verdict:
        say(f"{printable(name):22}  {formatted(text)}")


def rows(values: Any) -> list[Row]:
    """Rows of a mapping; empty for anything else."""
    if not isinstance(values, Mapping):
        return []
    return [(printable(name), "", value) for name, value in values.items()]


def sources(folder: Path, captions: Mapping[str, str]) -> dict[str, str]:
    """Existing files of a folder as data URLs by caption."""
    urls = {}
    for name, caption in captions.items():
        file = folder / name
        if file.is_file():
            data = b64encode(file.read_bytes()).decode()
            urls[caption] = f"data:{_MEDIA[file.suffix]};base64,{data}"
    return urls
