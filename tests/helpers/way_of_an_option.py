"""Prints how many files and functions of the package an option of a law goes through.

The locking angle of a shear law is followed from the command line, or from a case file,
until the ply is built.  Counted is each function of the package, once, of which an
argument has the number, be it as the word that was typed, in a table of the case, or in
radians within a law or a fabric.  Comprehensions and lambdas do not count.

    python -m tests.helpers.way_of_an_option [-v]

``-v`` lists the functions in the order in which they are entered.
"""

import contextlib
import io
import sys
import tempfile
from pathlib import Path

import skfem_textile
from skfem_textile.cli import main as cli

PACKAGE = Path(skfem_textile.__file__).parent

#: The angle in degrees as typed, and its first digits in radians.
ANGLE, RADIANS = "59.731", "1.0425"


def entered_functions():
    """Functions in the order in which they are entered, as pairs of file and name."""
    entered, built = {}, False

    def enter(frame, event, _):
        nonlocal built
        code = frame.f_code
        file = Path(code.co_filename)
        if built or event != "call" or code.co_name.startswith("<"):
            return
        if not file.is_relative_to(PACKAGE):
            return
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount + 2]
        if any(_has_angle(frame.f_locals.get(name)) for name in names):
            entered[str(file.relative_to(PACKAGE)), code.co_qualname] = None
        built = code.co_qualname == "Ply.__init__"

    law = ["--shear-law", "locking", "--set", f"shear.locking_angle_deg={ANGLE}"]
    command = ["run", "bias_extension", "--size", "2x4", "--steps", "1", *law]
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as quiet:
        quiet.enter_context(contextlib.redirect_stdout(io.StringIO()))
        quiet.enter_context(contextlib.redirect_stderr(io.StringIO()))
        sys.setprofile(enter)
        try:
            cli.main([*command, "--no-render", "--out", folder])
        finally:
            sys.setprofile(None)
    return list(entered)


def _has_angle(value):
    try:
        text = repr(value)
    except Exception:  # of a partly initialised object
        return False
    return ANGLE in text or RADIANS in text


if __name__ == "__main__":
    functions = entered_functions()
    if "-v" in sys.argv[1:]:
        for file, name in functions:
            print(file, name)
    print(f"{len({file for file, _ in functions})} files, {len(functions)} functions")
