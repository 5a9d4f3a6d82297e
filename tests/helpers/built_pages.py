"""Defects of the built pages that show only where they are served.

    python -m tests.helpers.built_pages docs/_build

Pages must work from any folder, from ``file://`` and without a network: each link leads
to a file, and an anchor, of the build, or to another site; what a page loads is in the
build; no file names a folder of the machine that built it.  Each script of the gallery
has a page with a picture that it drew.
"""

import re
import sys
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

ROOT = Path(__file__).parents[2]

# Attributes with an address: links are followed, all else is loaded with the page.
_ADDRESSES = {"href", "src", "poster", "data", "srcset"}
_LINKS = {"a", "area"}

# Files with text in which the name of a folder may be left.
_TEXTS = {".css", ".csv", ".html", ".inv", ".ipynb", ".js", ".json", ".svg", ".txt"}


class _Page(HTMLParser):
    """The addresses and the anchors of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag links to, loads and is named."""
        for name, value in attrs:
            if value and name in ("id", "name"):
                self.anchors.add(value)
            elif value and name in _ADDRESSES:
                found = self.links if tag in _LINKS else self.loaded
                found += re.split(r" \d\S*,? *", value) if name == "srcset" else [value]


@cache
def _page(file: Path) -> _Page:
    return _Page(file.read_text(encoding="utf-8"))


def defects(build: Path) -> Iterator[str]:
    """Defects of the pages in a folder, one line each."""
    build = build.resolve()
    for file in sorted(build.rglob("*")):
        if file.suffix in _TEXTS and str(ROOT) in file.read_text("utf-8", "replace"):
            yield f"{file.relative_to(build)}: contains the path of the repository"
        if file.suffix == ".html":
            for address in {*_page(file).links, *_page(file).loaded}:
                if reason := _defect(address, file, build):
                    yield f"{file.relative_to(build)}: {address}: {reason}"


def without_picture(build: Path) -> Iterator[Path]:
    """Scripts of the gallery without a page that shows a picture."""
    for head in sorted((ROOT / "examples").rglob("GALLERY_HEADER.rst")):
        for script in sorted(head.parent.glob("*.py")):
            place = script.relative_to(ROOT / "examples").with_suffix(".html")
            page = build / "gallery" / place
            if not page.is_file() or not any(
                f"sphx_glr_{script.stem}_" in address for address in _page(page).loaded
            ):
                yield script


def _defect(address: str, file: Path, build: Path) -> str | None:
    """Why an address on a page does not work everywhere; None if it does."""
    parts = urlsplit(address)
    if parts.scheme in ("data", "mailto", "javascript"):
        return None
    if parts.scheme in ("http", "https"):
        return "is loaded from a network" if address in _page(file).loaded else None
    if parts.scheme or parts.netloc or parts.path.startswith("/"):
        return "is an absolute address"
    target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
    if not target.is_relative_to(build):
        return "leads out of the pages"
    if not target.is_file():
        return "is missing"
    anchor = unquote(parts.fragment)
    if anchor and target.suffix == ".html" and anchor not in _page(target).anchors:
        return "has no such anchor"
    return None


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    found = list(defects(folder))
    found += [f"{script}: no picture" for script in without_picture(folder)]
    print(*found, sep="\n")
    print(f"{len(found)} defects in {sum(1 for _ in folder.rglob('*.html'))} pages")
    sys.exit(bool(found))
