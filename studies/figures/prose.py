"""Find results in prose that are not marked."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

from .pages import MARKED, ROOT

#: Phrases with numbers other than results: settings, definitions, literature values.
SETTINGS = Path(__file__).with_name("settings.toml")

#: Pages with results: all except pages that only describe interfaces and formulas.
CHECKED = (
    ROOT / "README.md",
    ROOT / "paper" / "paper.md",
    ROOT / "docs" / "index.md",
    *(
        page
        for folder in ("benchmarks", "how-to", "tutorial")
        for page in sorted((ROOT / "docs" / folder).glob("*.md"))
    ),
)

# Figures and notes, whose content is prose.
_FIGURE = re.compile(
    r"^```\{(?:figure|image|note|warning|tip|important|list-table)\}[^\n]*\n(.*?)^```$",
    re.M | re.S,
)

# Code, formulas, addresses, MyST directives and front matter.
_NO_PROSE = re.compile(
    r"\A---\n.*?\n---$|^```.*?^```$|^:(?!alt:)\w+:[^\n]*$"
    r"|``[^`]+``|`[^`]*`|\$\$.*?\$\$|\$[^$\n]*\$|\]\([^)]*\)|<[^>\n]*>",
    re.M | re.S,
)

# A number, and the features of a result: a unit, a per cent, a factor, a ratio, a count
# of runs, or sufficient size or precision.
_NUMBER = r"[−+-]?\d[\d.,]*\d?(?:·10)?[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]*"
_UNIT = (
    r"\s?%|\s?°|\s(?:per cent|mm|N|GPa|MPa|s|ms|µs|h|min|seconds?|minutes?|hours?"
    r"|GiB|MiB|GB|MB|times|iterations|solves|cases|runs|problems|medians|meshes"
    r"|trials|files|seeds|unknowns|elements)\b"
)
_RESULT = re.compile(
    rf"(?<![\w.=/^§])(?:1/{_NUMBER}|{_NUMBER}(?:{_UNIT})|{_NUMBER} of (?:the )?\d+"
    rf"|{_NUMBER}\s?×(?!\s?\d)|[−+-]?\d+\.\d+|(?!(?:19|20)\d\d\b)\d{{3,}}\b"
    r"|\d+/\d+|\d+ to \d+\b|\d+-fold|\d+x\b|\d+(?: [a-z]+)? "
    r"(?:iterations|steps|solves|cases|runs|problems|medians|meshes)\b)"
)

# A number after a symbol and an equals sign is a setting.
_ONE = rf"{_NUMBER}(?:{_UNIT})?"
_SET = re.compile(
    rf"(?<![A-Za-z]{{3}})(?<![A-Za-z]{{3}} )=\s*{_ONE}(?:(?:,| and| or| to) {_ONE})*"
)


def settings() -> dict[str, list[str]]:
    """Reviewed phrases of each page."""
    return tomllib.loads(SETTINGS.read_text(encoding="utf-8"))


def unmarked() -> list[str]:
    """Results without a marker, and reviewed phrases missing from their page."""
    reviewed, defects = settings(), []
    for page in CHECKED:
        name = str(page.relative_to(ROOT))
        prose = of_page(page.read_text(encoding="utf-8"))
        for phrase in reviewed.get(name, []):
            if phrase not in prose:
                defects.append(
                    f"{SETTINGS.name}: the phrase {phrase!r} is not in {name}"
                )
            prose = prose.replace(phrase, " ")
        defects += [
            f"{name}: the result {found!r} has no marker in {near!r}"
            for found, near in results_in(prose)
        ]
    return defects


def of_page(text: str) -> str:
    r"""The prose of a page outside markers, with single spaces.

    Examples
    --------
    >>> of_page("Within `3 %` or <!--a.b-->4 %<!--/-->, at\nmost.")
    'Within · or ·, at most.'
    """
    text = _FIGURE.sub(r"\1", MARKED.sub("·", text))
    return " ".join(_NO_PROSE.sub("·", text).split())


def results_in(prose: str) -> Iterator[tuple[str, str]]:
    """Each result in a text, with the surrounding words.

    Examples
    --------
    >>> [result for result, _ in results_in("It takes 3.2 s with γ = 40° on 5 meshes.")]
    ['3.2 s', '5 meshes']
    """
    prose = _SET.sub("=", prose)
    for match in _RESULT.finditer(prose):
        start, end = max(match.start() - 30, 0), match.end() + 30
        yield match[0], prose[start:end]
