"""Quantities of tests: their names in the files of testing machines, and units."""

import re
import tomllib
import unicodedata
from importlib.resources import files

from ...fabric.laws.tabulated import ANGLE, BENDING_MOMENT, CURVATURE
from ...mesh.user_input import IN_MM

_FORCE = {
    **{"N": 1.0, "kN": 1000.0, "cN": 0.01, "mN": 0.001, "daN": 10.0},
    **{"lbf": 4.4482216152605, "kgf": 9.80665, "gf": 9.80665e-3},
}
_STRAIN = {"-": 1.0, "1": 1.0, "mm/mm": 1.0, "m/m": 1.0, "%": 0.01}
_FORCE_PERIN_MM = {"N/mm": 1.0, "kN/m": 1.0}

#: Columns of a test by name, with the factors of their units to mm, N, radians, strain,
#: N/mm, 1/mm and N·mm/mm.
COLUMNS: dict[str, dict[str, float]] = {
    "displacement": IN_MM,
    "force": _FORCE,
    "half-width of the force": _FORCE,
    "lowest force of the samples": _FORCE,
    "highest force of the samples": _FORCE,
    "shear angle": ANGLE,
    "normalised shear force": _FORCE_PERIN_MM,
    "strain": _STRAIN,
    "warp strain": _STRAIN,
    "weft strain": _STRAIN,
    "warp force": _FORCE,
    "weft force": _FORCE,
    "overhang": IN_MM,
    "chord angle": ANGLE,
    "curvature": CURVATURE,
    "bending moment": BENDING_MOMENT,
}

#: Quantities with a sign that depends on the machine: forces.
FORCES = "force", "warp force", "weft force", "bending moment"

#: Quantities of which a number of another unit goes unnoticed: ratios and curvatures.
UNITLESS = (ANGLE, _STRAIN, CURVATURE)

_HEADINGS = tomllib.loads(
    files(__package__).joinpath("headings.toml").read_text(encoding="utf-8")
)
_WORDS, _FAMILIES = (
    {name: frozenset(words.split()) for name, words in _HEADINGS[table].items()}
    for table in ("quantity", "family")
)
_UNIT_ALSO = {
    word: unit for unit, words in _HEADINGS["unit"].items() for word in words.split()
}

# Words of columns that no fit uses, or of one number of a curve; and their units.
_OTHER, _OTHER_UNITS = (
    frozenset(_HEADINGS["other"][key].split()) for key in ("words", "units")
)

#: Words of titles that name a specimen.
SPECIMENS = frozenset(_HEADINGS["specimen"]["words"].split())

_WORD = re.compile(r"[^\W\d_]+")
_SPACES = re.compile(r"[\s_]+")
_BRACKETS = re.compile(r"\s*(.*?)[\s,/:]*[(\[<]\s*(.*?)\s*[)\]>]\s*")
_TRAILING = re.compile(r"\s*(.*?)(?:\s*[,/:]\s*|[\s_]+(?:(?:in|en)\s+)?)(\S+)\s*")


def named_unit(text: str) -> str:
    """Unit in the spelling of `COLUMNS`; the text itself if unknown."""
    unit = text.strip().strip("()[]<>").strip() or text.strip()
    if any(unit in units for units in COLUMNS.values()) or unit in _OTHER_UNITS:
        return unit
    return _UNIT_ALSO.get(unit.lower(), unit)


def is_unit(text: str) -> bool:
    """True if a text is a unit of any column of a testing machine."""
    unit = named_unit(text)
    known = any(unit in units for units in COLUMNS.values() if unit != "1")
    return known or unit in _OTHER_UNITS


def split_heading(text: str) -> tuple[str, str]:
    """Name and unit of a heading such as ``Force (N)``, ``Kraft in N`` or ``F / N``."""
    if heading := _BRACKETS.fullmatch(text):
        return heading[1].strip(), named_unit(heading[2])
    heading = _TRAILING.fullmatch(text)
    if heading and heading[1] and is_unit(heading[2]):
        return heading[1].strip(), named_unit(heading[2])
    return text.strip(), ""


def column_named(word: str) -> str:
    """Name of a quantity, as in `COLUMNS`, from a heading without unit."""
    name = _SPACES.sub(" ", word.strip().lower())
    return name if name in COLUMNS else _by_words(name) or name


def _by_words(name: str) -> str:
    plain = "".join(
        char
        for char in unicodedata.normalize("NFKD", name)
        if not unicodedata.combining(char)
    )
    words = set(_WORD.findall(plain))
    if words & _OTHER and name != "shear angle":
        angle = "shear" in words and words & _WORDS["shear angle"]
        return "shear angle" if angle and not words & (_OTHER - {"shear"}) else ""
    meant = [quantity for quantity, of in _WORDS.items() if words & of]
    family = [family for family, of in _FAMILIES.items() if words & of]
    if family and meant and meant[0] in ("force", "strain"):
        return f"{family[0]} {meant[0]}"
    return meant[0] if meant and not family else ""


def quantity_of(name: str, unit: str) -> tuple[str, bool]:
    """Quantity of a column and True if its name says so; empty if it is unknown.

    The unit decides where the name does not: newtons are a force.
    """
    named = column_named(name)
    if named == "strain" and unit in IN_MM:
        named = "displacement"  # an elongation, which machines also name strain
    elif named == "displacement" and unit in _STRAIN:
        named = "strain"
    if named in COLUMNS:
        return named, True
    plain = set(_WORD.findall(name.lower()))
    if unit and unit != "1" and not plain & _OTHER:
        for quantity in ("displacement", "force", "shear angle"):
            if unit in COLUMNS[quantity]:
                return quantity, False
    return "", False


def recognised(text: str) -> bool:
    """True if a cell is a heading or a unit."""
    name, unit = split_heading(text)
    words = set(_WORD.findall(name.lower()))
    return bool(quantity_of(name, unit)[0] or is_unit(text) or words & _OTHER)
