"""The command ``show`` for a fabric: its laws, their sources and assumptions."""

from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..fabric.origin import Origin
from ..fabric.scatter import band_of_law
from ..io import read_fabric
from ..io.fabrics import FabricOfFile
from ..mesh.user_input import printable
from .interruption import held
from .output import complain, say
from .page import Row, say_rows
from .result_folder import ResultFolder

# Picture of the laws.
_PICTURE = "laws.png"

# Confidence level of the bands of a law.
_CONFIDENCE = 0.95

# Shares of the measured range at which the shear law is printed.
_SHARES = 0.25, 0.5, 1.0


def show_fabric(options: Namespace) -> int:
    """Print a fabric, and draw its laws into a folder; returns the exit code.

    Raises
    ------
    ValueError
        If there is no such fabric, or an option applies to meshes only.
    """
    for name in ("directions", "warp", "weft"):
        if getattr(options, name) is not None:
            raise ValueError(f"--{name} applies to a mesh only: omit it")
    found = read_fabric(options.mesh)
    say_rows(_rows(found))
    if options.out is None or options.no_render:
        return 0
    _draw(found, options.out)
    return 0


def _draw(found: FabricOfFile, out: Path) -> None:
    """Draw the picture, or print the reason why not."""
    try:
        with held(), ResultFolder(out, (_PICTURE,)) as folder:
            from ..plot import fabric_laws

            fabric_laws(found.fabric, found.origin, folder / _PICTURE)
    except ImportError as error:
        complain(f"the picture was not drawn: {printable(error)}")
    else:
        say(f"laws drawn in {printable(out / _PICTURE)}")


def _rows(found: FabricOfFile) -> Iterator[Row]:
    """Rows: laws, each measured or assumed, then what is known of them."""
    fabric, origin = found.fabric, found.origin or Origin()

    def assumed(name: str) -> str:
        return " (assumed)" if name in origin.assumed else ""

    if origin.title:
        yield "Fabric", "", origin.title
    yield from _shear_rows(fabric.shear_law, origin)
    for family in fabric.families:
        yield f"Tension, {family.name}", "", f"{family.tension!r}{assumed('tension')}"
    warp, weft = fabric.bending
    yield "Bending stiffness", "", f"{warp}, {weft} N mm{assumed('bending')}"
    for name, text in origin.assumed.items():
        yield f"Assumed, {name.replace('_', ' ')}", "", text
    for name, text in origin.sources.items():
        yield f"Source, {name}", "", text
    for part, specimens in origin.specimens.items():
        yield f"Specimens, {part}", "", "; ".join(one.name for one in specimens)
    for name, text in origin.properties.items():
        yield f"{name[:1].upper()}{name[1:]}", "", text
    for text in origin.notes:
        yield "Note", "", text
    if origin.reference:
        yield "Reference", "", origin.reference
    if found.origin is None:
        yield "Note", "", "the file does not state where its laws come from"


def _shear_rows(law: Any, origin: Origin) -> Iterator[Row]:
    """Shear moments at some angles, with the band of a further specimen."""
    yield "Shear law", "", repr(law)
    if (end := origin.ranges.get("shear")) is None:
        return
    x = end * np.array(_SHARES)
    band = band_of_law(origin.specimens.get("shear", ()), x, _CONFIDENCE)
    for i, (angle, moment) in enumerate(zip(x, law.value(x), strict=True)):
        text = f"{moment:.3g} N mm/mm2"
        if band is not None:
            low, high = band[:, i]
            text += f", 95 % band of a further specimen {low:.3g} to {high:.3g}"
        yield f"  at {np.degrees(angle):.1f}°", "", text
