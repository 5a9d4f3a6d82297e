"""Find results in prose that no block of their page states."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

from .pages import BLOCK, ROOT

#: Phrases with numbers other than results: settings, definitions, literature values.
SETTINGS = Path(__file__).with_name("settings.toml")

#: Pages with results: all except pages that only describe interfaces and formulas.
CHECKED = (
    ROOT / "README.md",
    ROOT / "paper" / "paper.md",
    ROOT / "docs" / "index.md",
    ROOT / "docs" / "validation.md",
    *(
        page
        for folder in ("benchmarks", "how-to", "tutorial")
        for page in sorted((ROOT / "docs" / folder).glob("*.md"))
    ),
)

# Code, formulas, addresses and front matter.
_NO_PROSE = re.compile(
    r"\A---\n.*?\n---$|^```.*?^```$|``[^`]+``|`[^`]*`|\$\$.*?\$\$|\$[^$\n]*\$"
    r"|\]\([^)]*\)|<(?:img src=\S+|/?\w*)|\bwidth=\S+",
    re.M | re.S,
)

# Tables that a page includes.
_INCLUDED = re.compile(r"^\[Table: [^\]]+\]\((\S+)\)$", re.M)

# A number, and the features of a result: a unit, a per cent, a factor, a ratio, a count
# of runs, or sufficient size or precision.
_NUMBER = r"[−+-]?\d[\d.,]*\d?(?:·10)?[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]*"
_UNIT = (
    r"(?:\s?[%°]|\s(?:per cent|mm|N|GPa|MPa|s|ms|µs|h|min|seconds?|minutes?|hours?"
    r"|GiB|MiB|GB|MB)\b)"
)
_COUNTED = (
    r"\s(?:times|iterations|solves|steps|cases|runs|problems|medians|meshes"
    r"|trials|files|seeds|unknowns|elements)\b"
)
_RESULT = re.compile(
    rf"(?<![\w.=/^§])(?P<value>1/{_NUMBER}|{_NUMBER}{_UNIT}|{_NUMBER} of (?:the )?\d+"
    rf"|{_NUMBER}(?=\s?×(?!\s?\d)|{_COUNTED})|[−+-]?\d+\.\d+"
    rf"|(?!(?:19|20)\d\d\b)\d{{3,}}\b|\d+/\d+|\d+ to \d+\b|\d+(?=-fold|x\b)"
    rf"|\d+(?= [a-z]+{_COUNTED}))"
)

# A number after a symbol and an equals sign is a setting.
_ONE = rf"{_NUMBER}(?:{_UNIT}|{_COUNTED})?"
_SET = re.compile(
    rf"(?<![A-Za-z]{{3}})(?<![A-Za-z]{{3}} )=\s*{_ONE}(?:(?:,| and| or| to) {_ONE})*"
)


def settings() -> dict[str, list[str]]:
    """Reviewed phrases of each page."""
    return tomllib.loads(SETTINGS.read_text(encoding="utf-8"))


def unproven() -> list[str]:
    """Results that no block states, and reviewed phrases missing from their page."""
    reviewed, defects = settings(), []
    for page in CHECKED:
        name, text = str(page.relative_to(ROOT)), page.read_text(encoding="utf-8")
        prose, generated = of_page(text), generated_on(text, page.parent)
        for phrase in reviewed.get(name, []):
            if phrase not in prose:
                defects.append(
                    f"{SETTINGS.name}: the phrase {phrase!r} is not in {name}"
                )
            prose = prose.replace(phrase, " ")
        defects += [
            f"{name}: no block of the page states the result {found!r} in {near!r}"
            for found, near in results_in(prose)
            if not stated(found, generated)
        ]
    return defects


def generated_on(text: str, folder: Path) -> str:
    """Content of the blocks of a page, and of the tables that it includes."""
    tables = [(folder / name).read_text("utf-8") for name in _INCLUDED.findall(text)]
    return "\n".join([*(block[2] for block in BLOCK.findall(text)), *tables])


def stated(result: str, generated: str) -> bool:
    """True if a text contains a result with this unit, or without any.

    Examples
    --------
    >>> [stated(x, "| 3.1 % | 12 |") for x in ("3.1 %", "3.1", "1 %", "12", "2")]
    [True, False, False, True, False]
    """
    whole = rf"(?<![\d.,−+-]){re.escape(result)}(?![.,]?\d)(?!{_UNIT})"
    return re.search(whole, generated) is not None


def of_page(text: str) -> str:
    r"""The prose of a page outside blocks, with single spaces.

    Examples
    --------
    >>> of_page("Within `3 %`\n<!--results a-->\n4 %\n<!--/results-->\nat most.")
    'Within · · at most.'
    """
    text = _NO_PROSE.sub("·", BLOCK.sub("·", text))
    return " ".join(text.split())


def results_in(prose: str) -> Iterator[tuple[str, str]]:
    """Each result in a text, with its unit, and with the surrounding words.

    Examples
    --------
    >>> [result for result, _ in results_in("It takes 3.2 s with γ = 40° on 5 meshes.")]
    ['3.2 s', '5']
    """
    prose = _SET.sub("=", prose)
    for match in _RESULT.finditer(prose):
        start, end = max(match.start() - 30, 0), match.end() + 30
        yield match["value"], prose[start:end]
