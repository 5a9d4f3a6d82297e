"""Pages of the API, one for each name that a page of names lists."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sphinx.ext.autosummary import autosummary_toc

_REFERENCE = Path(__file__).parent / "reference"
_LISTS = (*sorted((_REFERENCE / "api").glob("*.md")), _REFERENCE / "internals.md")
_PACKAGE = "skfem_textile"

# A block of ``autosummary``, with its options and its names.
_BLOCK = re.compile(
    r"^\.\. autosummary::\n(?:   :.*\n)*\n((?:   \S+\n)+)", re.MULTILINE
)


def listed() -> Iterator[tuple[str, Path]]:
    """Each listed name, such as ``skfem_textile.Ply``, and the page that lists it."""
    for page in _LISTS:
        for names in _BLOCK.findall(page.read_text(encoding="utf-8")):
            for name in names.split():
                yield f"{_PACKAGE}.{name}", page


def links_back() -> dict[str, str]:
    """For each name a link to the page that lists it."""
    return {
        name: f":doc:`/{page.relative_to(_REFERENCE.parent).with_suffix('')}`"
        for name, page in listed()
    }


def file_names() -> dict[str, str]:
    """Names of files for names that differ only in upper and lower case."""
    names = [name for name, _ in listed()]
    alike = Counter(name.lower() for name in names)
    seen: Counter[str] = Counter()
    files = {}
    for name in names:
        if alike[name.lower()] > 1:
            seen[name.lower()] += 1
            files[name] = f"{name}-{seen[name.lower()]}"
    return files


def remove_stale(app: Any) -> None:
    """Remove the pages of names that are not listed any more."""
    names = {name for name, _ in listed()}
    names |= set(file_names().values())
    for page in (_REFERENCE / "api" / "generated").glob("*.rst"):
        if page.stem not in names:
            page.unlink()


def remove_menus(app: Any, document: Any) -> None:
    """Keep the pages of single names, which are hundreds, out of the menu."""
    for menu in list(document.findall(autosummary_toc)):
        menu.parent.remove(menu)


def skip_field(
    app: Any, kind: str, name: str, member: Any, skip: bool, options: Any
) -> bool | None:
    """Skip fields of named tuples, which the docstring of their class describes."""
    return True if type(member).__name__ == "_tuplegetter" else None
