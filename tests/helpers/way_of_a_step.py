"""Prints how many files and functions of the package one load step goes through.

The step is the only one of a strip of macro-elements.  Counted is what is entered while
`LoadStepper.run` runs, set-up, diagnosis and result of the run included, and what was
made before it excluded: files of the package, and in them functions that have a name,
each once however often it is called.  What Python itself names with "<", such as
lambdas and comprehensions, and what is only imported, is no such function, and a file
in which nothing else is entered does not count.

    python -m tests.helpers.way_of_a_step [-v]

``-v`` lists the functions by file.
"""

import sys
from collections import defaultdict
from pathlib import Path

import skfem_textile
from skfem_textile import Fabric, LoadStepper, Macro, Ply
from skfem_textile.scenes import strip

PACKAGE = Path(skfem_textile.__file__).parent


def way():
    """Names of the functions that are entered, by file of the package."""
    scene = strip()
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, Macro())
    stepper, codes = LoadStepper(ply, scene.conditions, 1), set()

    def enter(frame, event, _):
        if event == "call":
            codes.add(frame.f_code)

    sys.setprofile(enter)
    try:
        stepper.run()
    finally:
        sys.setprofile(None)
    names = defaultdict(list)
    for code in codes:
        file = Path(code.co_filename)
        if file.is_relative_to(PACKAGE) and not code.co_name.startswith("<"):
            place = f"{code.co_qualname}:{code.co_firstlineno}"
            names[str(file.relative_to(PACKAGE))].append(place)
    return names


if __name__ == "__main__":
    names = way()
    if "-v" in sys.argv[1:]:
        for file, functions in sorted(names.items()):
            print(f"{file}:", *sorted(functions))
    print(f"{len(names)} files, {sum(map(len, names.values()))} functions")
