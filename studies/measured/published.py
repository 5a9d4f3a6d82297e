"""Published measurements: rows of the files in `data`, as curves and tests."""

import csv
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy import ndarray

from skfem_textile.calibration import (
    BiasExtension,
    PictureFrame,
    ShearTest,
    Specimen,
)

#: Folder of the files; each begins with its source.
DATA = Path(__file__).with_name("data")

#: Sources for pictures.
CAO = "Cao et al., Composites Part A 39 (2008) 1037"
NYLON = "Farrell et al., aerodynamic-textile-metamaterials"

FRAMES, BIAS = "picture frame", "bias extension"

#: Fabrics, with the figures of the picture frames, and of the bias extensions: forces,
#: and forces as normalised by the authors.
FABRICS = {
    "plain": ("28", "38", "39"),
    "balanced twill": ("29", "41", "42"),
    "unbalanced twill": ("30", "43", "44"),
}

#: Columns of the fabrics in the table of their properties.
_COLUMNS = {
    "plain": "TPEET22XXX plain",
    "balanced twill": "TPEET44XXX balanced twill 2/2",
    "unbalanced twill": "TPECU53XXX unbalanced twill 2/2",
}

# Assumed: weight of glass in a yarn, its density in g/mm³ and modulus in N/mm².
_GLASS, _DENSITY, _MODULUS = 0.6, 2.55e-3, 72e3

#: The assumption in words.
ASSUMED = (
    f"the glass of straight yarns: {100 * _GLASS:g} % of their weight, with "
    f"{1e-3 * _MODULUS:g} GPa and {1e3 * _DENSITY:g} g/cm3, times the counts of Table 1"
)


def rows(name: str) -> list[dict[str, str]]:
    """Rows of a file, without the lines of its source."""
    with (DATA / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def columns(name: str) -> dict[str, ndarray]:
    """Columns of numbers of a file."""
    table = rows(name)
    return {key: np.array([float(row[key]) for row in table]) for key in table[0]}


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of the benchmark.

    Attributes
    ----------
    name
        Laboratory of a picture frame; size and laboratory of a bias extension.
    test
        The test.
    x, y
        Shear angle in degrees and shear force in N/mm of a picture frame; displacement
        in mm and force in N of a bias extension.
    """

    name: str
    test: ShearTest
    x: ndarray
    y: ndarray

    @cached_property
    def specimen(self) -> Specimen:
        """Displacement and force of the machine, with the zeros as published."""
        if isinstance(self.test, BiasExtension):
            return Specimen(self.name, self.test, self.y, self.x)
        assert isinstance(self.test, PictureFrame)
        gamma, test = np.radians(self.x), self.test
        along = self.y * test.fabric**2 / test.frame
        force = 2 * np.cos(np.pi / 4 - gamma / 2) * along
        return Specimen(self.name, test, force, test.displacement(gamma))

    @property
    def first_loading(self) -> bool:
        """False for curves of specimens that had been loaded before."""
        return not self.name.endswith("3rd")


@cache
def curves(figure: str) -> tuple[Curve, ...]:
    """Curves of a figure, in its order."""
    frames = {
        row["group"]: (float(row["frame_mm"]), float(row["fabric_mm"]))
        for row in rows("cao2008/frames.csv")
    }
    points: dict[tuple[str, ...], list[tuple[float, float]]] = {}
    for row in rows("cao2008/curves.csv"):
        if row["figure"] == figure:
            name = row["specimen_or_laboratory"]
            key = name, row["width_mm"], row["height_mm"]
            points.setdefault(key, []).append((float(row["x"]), float(row["y"])))
    found = []
    for (name, width, height), pairs in points.items():
        x, y = np.transpose(sorted(pairs))
        test: ShearTest = (
            BiasExtension(float(width), float(height))
            if width
            else PictureFrame(*frames[name.split()[0]])
        )
        found.append(Curve(name, test, x, y))
    return tuple(found)


def of_fabric(fabric: str, test: str) -> tuple[Curve, ...]:
    """Picture frames or bias extensions of a fabric."""
    return curves(FABRICS[fabric][test == BIAS])


def error_bars(fabric: str) -> dict[str, ndarray]:
    """Displacements, forces and half-lengths of the bars of each bias extension."""
    found: dict[str, list[tuple[float, ...]]] = {}
    names = "displacement_mm", "force_N", "half_length_N"
    for row in rows("cao2008/error_bars.csv"):
        if row["fabric"] == fabric:
            bar = tuple(float(row[name]) for name in names)
            found.setdefault(row["specimen"], []).append(bar)
    return {name: np.transpose(bars) for name, bars in found.items()}


def properties(fabric: str) -> dict[str, str]:
    """Properties of a fabric by name with unit, as published."""
    table = rows("cao2008/fabrics.csv")
    return {row["property"]: row[_COLUMNS[fabric]] for row in table}


def property_of(fabric: str, name: str) -> float:
    """Property of a fabric: the first number of its cell."""
    return float(properties(fabric)[name].split("+-")[0].split()[0])


def fibre_stiffnesses(fabric: str) -> tuple[float, float]:
    """Assumed tension stiffness of warp and weft in N/mm: the glass of straight yarns.

    It was not measured.  The weight of glass is assumed.
    """
    tex = property_of(fabric, "yarn linear density tex")
    of_yarn = _GLASS * 1e-3 * tex * 1e-3 / _DENSITY * _MODULUS  # g/mm over g/mm³
    warp, weft = (
        of_yarn * property_of(fabric, f"{family} count /cm") / 10
        for family in ("warp", "weft")
    )
    return warp, weft


def sources(folder: str = ".") -> dict[str, list[str]]:
    """Lines of the source of each file in a folder of the data."""
    found = {}
    for file in sorted((DATA / folder).rglob("*.csv")):
        lines = file.read_text(encoding="utf-8").splitlines()
        found[file.name] = [line for line in lines if line.startswith("#")]
    return found
