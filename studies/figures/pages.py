"""Pages with results between markers.

A page says a result as ``<!--laws.worst-->3.3 %<!--/-->``: the name of a study, the
name of one of its `Study.figures`, and the text.  Renderers of Markdown do not show the
comments.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]

#: Every page that may say a result.
PAGES = (
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "paper" / "paper.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "how-to").glob("*.md")),
    *sorted((ROOT / "docs" / "reference").glob("*.md")),
    *sorted((ROOT / "docs" / "tutorial").glob("*.md")),
)

#: A marker with the name of a result and the text between.
MARKED = re.compile(r"<!--([a-z_0-9]+)\.(\S+?)-->(.*?)<!--/-->", re.S)


def markers(text: str) -> Iterator[tuple[str, str, str]]:
    """Study, name and text of each result on a page.

    Examples
    --------
    >>> list(markers("in <!--a.count-->3 of 4<!--/--> cases"))
    [('a', 'count', '3 of 4')]
    """
    for match in MARKED.finditer(text):
        yield match[1], match[2], match[3]


def filled(text: str, results: Mapping[str, Mapping[str, str]]) -> str:
    """The page with the results in place of what stands between its markers.

    Parameters
    ----------
    text
        The page.
    results
        Results by study and name.

    Raises
    ------
    ValueError
        If a marker names no result.

    Examples
    --------
    >>> filled("in <!--a.count-->3 of 4<!--/--> cases", {"a": {"count": "4 of 4"}})
    'in <!--a.count-->4 of 4<!--/--> cases'
    """

    def written(match: re.Match[str]) -> str:
        study, name, _ = match.groups()
        if name not in results.get(study, {}):
            raise ValueError(f"no result is named {study}.{name}")
        return f"<!--{study}.{name}-->{results[study][name]}<!--/-->"

    return MARKED.sub(written, text)
