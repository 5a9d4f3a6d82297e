"""Fabrics from `/MAT/LAW58` and `/MAT/LAW158` of OpenRadioss.

Fields and defaults follow ``hm_read_mat58.F`` and ``hm_read_mat158.F``, formulas
``sigeps58c.F`` and ``sigeps158c.F``.  The force F(d) of a yarn is given there per
thickness; times the thickness it is the force of `CrimpedYarns`.  The shear stress τ(Γ)
refers to the orthogonal axes midway between the families (``mulawc.F90``).  Its power
per reference area is t τ λ₁ λ₂ dΓ/dt, so that the moment is t τ for inextensible
fibres.
"""

import re
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..fabric import CrimpedYarns, Fabric, Law, Softening, Tabulated, TangentShear
from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt
from .file_numbers import errors_about, from_words

#: Width of a column of a card; floating-point numbers take two.
COLUMN = 10

# Fields of the cards by name: first column, and number of columns.
_CARDS_58 = (
    {"density": (0, 2)},
    {"E1": (0, 2), "B1": (2, 2), "E2": (4, 2), "B2": (6, 2), "Flex": (8, 2)},
    {"G0": (0, 2), "GT": (2, 2), "AlphaT": (4, 2), "Gsh": (6, 2), "sens_ID": (9, 1)},
    {"Df": (0, 2), "Ds": (2, 2), "Gfrot": (4, 2), "ZeroStress": (8, 2)},
    {
        "N1": (0, 1),
        "N2": (1, 1),
        "S1": (2, 2),
        "S2": (4, 2),
        "Flex1": (6, 2),
        "Flex2": (8, 2),
    },
    {"fct_ID1": (0, 1), "Fscale1": (2, 2)},
    {"fct_ID2": (0, 1), "Fscale2": (2, 2)},
    {"fct_ID3": (0, 1), "Fscale3": (2, 2)},
    {"fct_ID4": (0, 1), "fct_ID5": (1, 1), "fct_ID6": (6, 1)},
)
_CARDS_158 = (
    {"density": (0, 2)},
    {"S1": (0, 2), "S2": (2, 2), "Flex": (4, 2), "Flex1": (6, 2), "Flex2": (8, 2)},
    {"ZeroStress": (0, 2), "sens_ID": (3, 1)},
    *_CARDS_58[5:8],
    {"fct_ID4": (0, 1), "fct_ID5": (1, 1)},
)

# Defaults of hm_read_mat58.F and hm_read_mat158.F.
_CRIMP, _FLEX = 0.1, 1e-3

# Fields without a counterpart if they are not zero, and the reason.
_OTHERS = {
    "Gsh": "the ply lies in its plane",
    "sens_ID": "a reference state is not modelled",
    "Df": "the ply is in static equilibrium, without damping",
    "Ds": "yarns cross without friction",
    "Gfrot": "yarns cross without friction",
    "ZeroStress": "a reference state is not modelled",
    "density": "the ply is in static equilibrium",
}


class Option(NamedTuple):
    """Parts of the name of a keyword, its cards, and the numbers of all its lines."""

    name: list[str]
    cards: list[str]
    lines: list[int]


def read(
    content: bytes, thickness: float | None, stress: float, material: str | None
) -> tuple[Fabric, list[str]]:
    """Fabric of a deck, and messages about ignored data.

    ``stress`` is the unit of stress of the deck in N/mm².

    Raises
    ------
    MeshError
        If the deck violates its format or has no such material, or if no thickness is
        given.
    """
    every = options(content)
    laws = [
        o
        for o in every
        if o.name[0] == "MAT" and o.name[1:2] and o.name[1].upper() in _LAWS
    ]
    if material is not None:
        laws = [o for o in laws if o.name[2:3] == [material]]
    if not laws:
        wanted = "" if material is None else f" with the number {excerpt(material)}"
        raise MeshError(f"the file contains no /MAT/LAW58 or /MAT/LAW158{wanted}")
    if len(laws) > 1:
        raise MeshError(
            "the file contains several fabrics: specify the number of one material"
        )
    (option,) = laws
    name = "/" + "/".join(option.name[:3])
    if thickness is None:
        raise MeshError(f"{excerpt(name)}: specify the thickness in mm")
    build, cards, least = _LAWS[option.name[1].upper()]
    scale = thickness * stress
    with errors_about(excerpt(name)):
        fields = _fields(option.cards, cards, least)
        ignored = _ignored(option, fields)
        return build(fields, scale, _Functions(every, scale), ignored), ignored


def options(content: bytes) -> list[Option]:
    """All keywords, each with its cards."""
    found: list[Option] = []
    text = content.decode("utf-8-sig", "replace")
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text)):
        if line.startswith("/"):
            parts = [part.strip() for part in line[1:].split("/")]
            found.append(Option(parts, [], [number]))
        elif found and not line.startswith(("#", "$")):
            found[-1].cards.append(line)
            found[-1].lines.append(number)
    if not found:
        raise MeshError("the file contains no OpenRadioss keyword")
    return found


def _fields(
    cards: list[str], layout: tuple[dict[str, tuple[int, int]], ...], least: int
) -> dict[str, float]:
    """Numbers of the cards after the title, by name; blank ones are zero."""
    while cards and not cards[-1].strip():
        cards = cards[:-1]
    if len(cards) - 1 < least:
        raise MeshError(
            f"{max(len(cards) - 1, 0)} lines follow the title, but at least {least} "
            "are required"
        )
    if len(cards) - 1 > len(layout):
        raise MeshError(f"more than {len(layout)} lines follow the title")
    fields = {}
    for number, fields_of_card in enumerate(layout):
        card = cards[number + 1] if number + 1 < len(cards) else ""
        for name, (first, width) in fields_of_card.items():
            word = card[COLUMN * first : COLUMN * (first + width)].strip()
            kind = "i8" if width == 1 else "f8"
            with errors_about(name):
                fields[name] = from_words([word.encode() or b"0"], kind).item()
                if not np.isfinite(fields[name]):
                    raise MeshError("the number is not finite")
    return fields


def _ignored(option: Option, fields: dict[str, float]) -> list[str]:
    reasons = [f"{n}: {why}" for n, why in _OTHERS.items() if fields.get(n)]
    if option.name[3:4] not in ([], [""], ["0"]):
        reasons.append(
            f"/UNIT/{excerpt(option.name[3])}: the units specified with the deck are "
            "used instead"
        )
    return reasons


class _Functions:
    """Functions (/FUNCT) of a deck, as laws in N/mm."""

    def __init__(self, options: list[Option], scale: float) -> None:
        self._scale = scale
        self._cards = {
            o.name[1]: o.cards
            for o in options
            if o.name[0].upper() == "FUNCT" and len(o.name) > 1
        }

    def table(self, number: float, factor: float) -> tuple[ndarray, ndarray]:
        """Arguments and values of a function, times its factor and the thickness."""
        cards = self._cards.get(str(int(number)))
        if cards is None:
            raise MeshError(f"the file contains no /FUNCT/{int(number)}")
        rows = [card for card in cards[1:] if card.strip()]
        words = [(r[:20].strip().encode(), r[20:40].strip().encode()) for r in rows]
        numbers = from_words([w or b"0" for row in words for w in row], "f8")
        x, y = numbers.reshape(-1, 2).T
        return x, (factor or 1.0) * self._scale * y

    def yarn(self, number: float, factor: float) -> tuple[Law, float]:
        """Law of a yarn, and its slope at rest."""
        x, y = self.table(number, factor)
        law = Tabulated(x, y, "linear")
        at_rest = float(law.value(np.zeros(1))[0])
        ahead = x[x > 0]
        if at_rest or not len(ahead):
            raise MeshError(
                f"/FUNCT/{int(number)} must be zero at 0 and have points beyond 0"
            )
        slope = float(law.value(ahead[:1])[0]) / float(ahead[0])
        return law, slope


_STRAIGHT_LINES = (
    "functions: OpenRadioss interpolates linearly; the laws here interpolate the same "
    "points with a monotone cubic"
)


def _law58(
    f: dict[str, float], scale: float, tables: _Functions, ignored: list[str]
) -> Fabric:
    for name in ("N1", "N2"):
        if f[name] not in (0, 1):
            raise MeshError(
                f"{name} = {f[name]:g} is not supported: convert the yarn data "
                f"to {name} = 1"
            )
    crimp = [f["S1"] or _CRIMP, f["S2"] or _CRIMP]
    flex = f["Flex"] or _FLEX
    flexes = (f["Flex1"] or f["Flex2"] or flex, f["Flex2"] or f["Flex1"] or flex)
    yarns, springs = [], []
    for i, (s, k) in enumerate(zip(crimp, flexes, strict=True), 1):
        if f[f"fct_ID{i}"]:
            yarn, slope = tables.yarn(f[f"fct_ID{i}"], f[f"Fscale{i}"])
            slope = slope or scale * f[f"E{i}"]
        else:
            slope = scale * f[f"E{i}"]
            yarn = Softening(slope, scale * f[f"B{i}"])
        yarns.append(yarn)
        # Sine of the crimp angle: height of the crimp over the length of the yarn.
        springs.append(k * slope * float(np.sqrt((1 + s) ** 2 - 1) / (1 + s)))
    if f["fct_ID1"] or f["fct_ID2"]:
        ignored += [
            "functions of warp and weft: OpenRadioss scales the crimp spring with the "
            "slope of the function; here the slope at rest is used",
            _STRAIGHT_LINES,
        ]
    for i, name in ((4, "warp"), (5, "weft"), (6, "shear")):
        if f[f"fct_ID{i}"]:
            ignored.append(f"fct_ID{i}: unloading of {name} follows the loading")
    law = CrimpedYarns((yarns[0], yarns[1]), tuple(crimp), tuple(springs))
    if f["fct_ID3"]:
        return Fabric(law, _shear(f, tables, ignored))
    GT = f["GT"] or 0.25 * (f["E1"] + f["E2"])
    cosine = 0.5 * sum(np.sqrt((1 + s) ** 2 - 1) for s in crimp)
    if not f["AlphaT"] and cosine >= 1:
        raise MeshError(
            "AlphaT must be specified, because its default is undefined for this "
            "amount of crimp"
        )
    lock = np.radians(f["AlphaT"]) if f["AlphaT"] else float(np.arccos(cosine))
    G = GT / (1 + np.tan(lock) ** 2)
    shear = TangentShear(scale * (f["G0"] or G), scale * G, float(lock))
    return Fabric(law, shear)


def _law158(
    f: dict[str, float], scale: float, tables: _Functions, ignored: list[str]
) -> Fabric:
    for i in (1, 2, 3):
        if not f[f"fct_ID{i}"]:
            raise MeshError(f"fct_ID{i} must name a function")
    for i, name in ((4, "warp"), (5, "weft")):
        if f[f"fct_ID{i}"]:
            ignored.append(
                f"fct_ID{i}: this function is ignored, and the crimp spring of the "
                f"{name} remains logarithmic"
            )
    if any(f[f"Fscale{i}"] not in (0, 1) for i in (1, 2, 3)):
        ignored.append(
            "Fscale: functions are scaled here as documented; sigeps158c.F omits the "
            "scales of forces and shear stress"
        )
    yarns = [tables.yarn(f[f"fct_ID{i}"], f[f"Fscale{i}"])[0] for i in (1, 2)]
    ignored.append(_STRAIGHT_LINES)
    springs = (scale * (f["Flex1"] or 1.0), scale * (f["Flex2"] or 1.0))
    crimp = (f["S1"] or _CRIMP, f["S2"] or _CRIMP)
    law = CrimpedYarns((yarns[0], yarns[1]), crimp, springs, scale * (f["Flex"] or 1.0))
    return Fabric(law, _shear(f, tables, ignored))


def _shear(f: dict[str, float], tables: _Functions, ignored: list[str]) -> Law:
    """Law of a function of the shear angle in degrees."""
    x, y = tables.table(f["fct_ID3"], f["Fscale3"])
    if one_sided := bool(len(x)) and bool((x >= 0).all()):
        ignored.append("fct_ID3: the law of positive angles is used for both signs")
    if _STRAIGHT_LINES not in ignored:
        ignored.append(_STRAIGHT_LINES)
    return Tabulated(np.radians(x), y, "linear", one_sided)


# Functions that build the laws, their cards, and the minimum number of cards.
_LAWS = {
    **dict.fromkeys(("LAW58", "FABR_A"), (_law58, _CARDS_58, 5)),
    **dict.fromkeys(("LAW158", "FABR_NL"), (_law158, _CARDS_158, 6)),
}
