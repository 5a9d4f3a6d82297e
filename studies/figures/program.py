"""``python -m studies figures``: pages and tables say what the stored results say."""

from pathlib import Path

from skfem_textile.cli.output import complain, say

from ..common import provenance
from ..study import descriptions, load
from .pages import PAGES, ROOT, filled, markers
from .prose import unmarked
from .results import differences, folder_of, in_words, outdated_tables


def main(check: bool) -> int:
    """Write every result into its page, or compare; returns the exit code.

    Parameters
    ----------
    check
        Write nothing.  Name each page and table that differs from the results, each
        result in prose without a marker, and each sample that the code computes
        differently now.
    """
    texts: dict[Path, str] = {}
    for name in descriptions():
        if _published(name):
            texts |= outdated_tables(name)
    words: dict[str, dict[str, str]] = {}
    defects = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for study in {study for study, _, _ in markers(text)} - words.keys():
            words[study] = in_words(study) if study in descriptions() else {}
        try:
            right = filled(text, words)
        except ValueError as error:
            defects.append(f"{_name(page)}: {error}")
            continue
        if right != text:
            texts[page] = right
    if not check:
        for file, text in texts.items():
            file.write_text(text, encoding="utf-8", newline="")
            say(f"wrote {_name(file)}")
    else:
        defects += [f"{_name(file)} differs from its data" for file in texts]
        defects += unmarked()
        for name in descriptions():
            if _published(name):
                folder = folder_of(name, load(name))
                if name not in provenance.read(folder):
                    defects.append(f"{_name(folder)} does not say where {name} is from")
                defects += differences(name)
    for defect in defects:
        complain(defect)
    return 1 if defects else 0


def _published(name: str) -> bool:
    """Whether the documentation has results of a study."""
    return folder_of(name, load(name)).is_dir()


def _name(file: Path) -> str:
    return str(file.relative_to(ROOT))
