"""``python -m studies figures``: update pages and tables from the stored results.

Blocks state results between the lines ``<!--results NAME-->`` and
``<!--/results-->`` of a page.  The template of a block is the file ``blocks/NAME.md``,
where ``{laws.worst}`` is the entry ``worst`` of `Study.figures` of the study ``laws``.
"""

import re
from argparse import ArgumentParser
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from skfem_textile.cli.output import complain, say

from ..common import provenance
from ..study import Row, Study, descriptions, load

ROOT = Path(__file__).parents[2]

#: Templates of the blocks.
BLOCKS = Path(__file__).with_name("blocks")

#: Pages with prose.
PAGES = (
    ROOT / "README.md",
    ROOT / "paper" / "paper.md",
    *(
        page
        for folder in (".", "benchmarks", "how-to", "reference", "theory", "tutorial")
        for page in sorted((ROOT / "docs" / folder).glob("*.md"))
    ),
)

#: A block: its first line, its name, its content and its last line.
BLOCK = re.compile(r"^(<!--results ([\w-]+)-->\n)(.*?)^(<!--/results-->)$", re.M | re.S)

#: A result in a template: the study and the name.
RESULT = re.compile(r"\{([a-z_0-9]+)\.([^}\s]+)\}")

# Relative and absolute tolerances for equal numbers.  Round-off differs between
# processors and linear-algebra libraries; nearly singular tangents amplify it.  Pages
# show four digits at most.
_SAME, _NOTHING = 1e-4, 1e-7


def main(check: bool) -> int:
    """Write or compare the results on the pages; returns the exit code.

    Parameters
    ----------
    check
        Write nothing.  Report each page and table that differs from the results, each
        result in prose that no block states, and each sample whose recomputed rows
        differ.
    """
    from .pictures import reduce, without_palette
    from .prose import unproven

    studies = {name: load(name) for name in descriptions()}
    published = {n: s for n, s in studies.items() if _folder_of(n, s).is_dir()}
    texts: dict[Path, str] = {}
    results: dict[str, dict[str, str]] = {}
    for name, study in published.items():
        folder = _folder_of(name, study)
        texts |= _outdated_tables(study, folder)
        results[name] = study.figures(study.stored(folder))
    defects = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        try:
            right = filled(text, results)
        except (ValueError, OSError) as error:
            defects.append(f"{_name(page)}: {error}")
            continue
        if right != text:
            texts[page] = right
    if check:
        defects += [
            f"{_name(file)} differs from its data: run python -m studies figures"
            for file in texts
        ]
        defects += unproven()
        defects += [
            f"{_name(file)} has no palette: run python -m studies figures"
            for file in without_palette()
        ]
        for name, study in published.items():
            folder = _folder_of(name, study)
            if name not in provenance.read(folder):
                defects.append(f"{_name(folder)}: the provenance of {name} is missing")
            defects += [f"{name}, {text}" for text in _differences(study, folder)]
    else:
        for file, text in texts.items():
            file.write_text(text, encoding="utf-8", newline="")
            say(f"wrote {_name(file)}")
        for file in without_palette():
            reduce(file)
            say(f"reduced {_name(file)} to 256 colours")
    for defect in defects:
        complain(defect)
    return 1 if defects else 0


def filled(text: str, results: Mapping[str, Mapping[str, str]]) -> str:
    """The page with its blocks as generated.

    Parameters
    ----------
    text
        The page.
    results
        Results by study and name.

    Raises
    ------
    ValueError
        If a template names an unknown result.
    OSError
        If a block has no template.
    """

    def result(match: re.Match[str]) -> str:
        study, name = match.groups()
        if name not in results.get(study, {}):
            raise ValueError(f"unknown result {study}.{name}")
        return results[study][name]

    def block(match: re.Match[str]) -> str:
        template = (BLOCKS / f"{match[2]}.md").read_text(encoding="utf-8")
        return f"{match[1]}\n{RESULT.sub(result, template)}\n{match[4]}"

    return BLOCK.sub(block, text)


def _folder_of(name: str, study: Study[Any]) -> Path:
    """Folder of the published results of a study."""
    return ROOT / "docs" / (study.folder or name)


def _name(file: Path) -> str:
    return str(file.relative_to(ROOT))


def _outdated_tables(study: Study[Any], folder: Path) -> dict[Path, str]:
    """Tables that differ from the stored rows, with the correct text.

    CSV files are included, which reveals most manual edits of cells.
    """
    texts = {folder / k: text for k, text in study.tables(study.stored(folder)).items()}
    return {
        file: text
        for file, text in texts.items()
        if not file.is_file() or file.read_bytes().decode() != text
    }


def _differences(study: Study[Any], folder: Path) -> list[str]:
    """Differences between the recomputed sample of a study and the stored rows."""
    if not study.sample:
        return []
    parser = ArgumentParser()
    study.add_options(parser)
    cases = {study.name(case): case for case in study.cases(parser.parse_args([]))}
    stored = study.stored(folder)
    return [
        f"{study.sample}: {column} is {value!r}, not {was!r}"
        for row in study.examine(cases[study.sample])
        for column, value, was in _apart(row, stored, study.volatile)
    ]


def _apart(
    row: Row, stored: Iterable[Row], volatile: tuple[str, ...]
) -> list[tuple[str, Any, Any]]:
    """Columns in which a row differs from the closest stored row."""
    steady = {k: v for k, v in row.items() if not any(part in k for part in volatile)}
    return min(
        (
            [(k, v, other.get(k)) for k, v in steady.items() if not _same(v, other, k)]
            for other in stored
        ),
        key=len,
        default=[("rows", len(row), 0)],
    )


def _same(value: Any, other: Row, column: str) -> bool:
    was = other.get(column)
    if isinstance(value, float) and isinstance(was, float | int):
        both_nan = value != value and was != was
        return both_nan or abs(value - was) <= _SAME * abs(was) + _NOTHING
    return bool(value == was) or (value in ("", None) and was in ("", None))
