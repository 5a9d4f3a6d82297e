"""The command ``init``: a case file as a starting point."""

import argparse

from ..cases.read import declared
from ..cases.write import case_text
from ..mesh.user_input import printable
from .output import say


def run(options: argparse.Namespace) -> int:
    """Write the case file of a scene with all defaults and comments.

    Returns the exit code.

    Raises
    ------
    OSError
        If the file exists or cannot be written.
    """
    name = printable(options.file.name)
    head = f"# A case file. Run it with: skfem-textile run {name} --out results"
    text = case_text(declared({"scene": {"name": options.scene}}), head)
    with open(options.file, "x", encoding="utf-8") as opened:
        opened.write(text)
    say(f"case file of the scene {options.scene} written to {printable(options.file)}")
    return 0
