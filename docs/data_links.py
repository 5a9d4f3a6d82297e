"""Links to the data of a page, beside its tables of results."""

import os
import re
from pathlib import Path

# The file of a study about its runs, in the folder of its data.
_PROVENANCE = "provenance.json"

_SHOWN = re.compile(
    r'^(?:\[Table: [^\]]+\]\(|!\[[^\]]*\]\(|<img src=")([^\s")]+)', re.MULTILINE
)
#: Links to files.
LINKED = re.compile(r"\]\(([^()\s]+)\)")


def with_data(text: str, page: Path) -> str:
    """The text of a page, at its end the data of its tables without a link."""
    folder = page.parent
    studies = {(folder / name).resolve().parent for name in _SHOWN.findall(text)}
    linked = {(folder / name).resolve() for name in LINKED.findall(text)}
    data = sorted(
        file
        for study in studies
        if (study / _PROVENANCE).is_file()
        for file in (*study.glob("*.csv"), *study.glob("*.json"))
        if file.name != _PROVENANCE and file not in linked
    )
    if not data:
        return text
    links = (
        f"[{file.name}]({os.path.relpath(file, folder.resolve())})" for file in data
    )
    return f"{text}\n## Data\n\nAll values: {', '.join(links)}.\n"
