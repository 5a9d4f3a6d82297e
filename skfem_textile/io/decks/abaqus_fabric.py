"""Fabrics from `*FABRIC` of Abaqus: test data of fill, warp and shear.

Abaqus states nominal stress over nominal strain along the yarns, and shear stress over
the drop of the angle between them, each the work conjugate of the other per reference
volume ("Fabric material behavior" in the Analysis User's Guide).  With the thickness t
and the strain e the tension is T(ln(1 + e)) = t (1 + e) σ(e), and the moment M = t τ.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ...fabric import Fabric, Law, Tabulated, TensionOnly
from ...mesh.checks import MeshError
from ...mesh.user_input import excerpt
from ..file_numbers import from_words
from .fabric_of_deck import FabricOfFile, Units
from .keywords import Block, blocks

# Components of *UNIAXIAL and what they are here: the first yarns are the fill.
_COMPONENTS = {"1": "weft", "2": "warp", "SHEAR": "shear"}

_SECTIONS = ("SHELL SECTION", "MEMBRANE SECTION")

# Other options of a material, and why they have no counterpart.
_OTHERS = {
    "DENSITY": "the ply is in static equilibrium",
    "DAMPING": "the ply is in static equilibrium",
    "EXPANSION": "there are no temperatures",
    "UNLOADING DATA": "laws are elastic: unloading follows the loading data",
    "DEPVAR": "laws have no state",
    "ELASTIC": "the plane of the fabric has the laws of *FABRIC alone",
    "PLASTIC": "laws are elastic",
    "VISCOELASTIC": "laws do not depend on time",
    "DAMAGE INITIATION": "laws are elastic",
    "DAMAGE EVOLUTION": "laws are elastic",
    "FAIL STRAIN": "states past a failure are judged by the load stepper alone",
    "FAIL STRESS": "states past a failure are judged by the load stepper alone",
    "SPECIFIC HEAT": "there are no temperatures",
    "CONDUCTIVITY": "there are no temperatures",
}

#: Keywords of a fabric: those that are read, and those that are told not to be.
KEYWORDS = ("MATERIAL", "FABRIC", "UNIAXIAL", "LOADING DATA", *_SECTIONS, *_OTHERS)


class _Data(NamedTuple):
    """Loading data of one direction: strains, stresses, and what follows beyond."""

    direction: str
    strain: ndarray
    stress: ndarray
    linear: bool


@dataclass
class _Material:
    """A material with *FABRIC: loading data by component, and what is left out."""

    name: str
    fabric: bool = False
    data: dict[str, list[_Data]] = field(default_factory=dict)
    not_taken: list[str] = field(default_factory=list)


def read(
    content: bytes, thickness: float | None, units: Units, material: str | None
) -> FabricOfFile:
    """Read a fabric from a deck.

    Raises
    ------
    MeshError
        If the deck departs from its format, has no such fabric or no thickness.
    """
    every = list(blocks(content))
    chosen = _chosen(_materials(every), material)
    if thickness is None:
        thickness = units.length * _thickness(every, chosen.name)
    not_taken = list(chosen.not_taken)
    laws = {
        component: _law(
            component,
            chosen.data.get(component, []),
            not_taken,
            thickness * units.stress,
        )
        for component in ("warp", "weft", "shear")
    }
    fabric = Fabric((laws["warp"], laws["weft"]), laws["shear"])
    not_taken.append(
        "Abaqus goes in straight lines between the points of the data; the laws here "
        "go through the same points in a monotone cubic"
    )
    return FabricOfFile(fabric, tuple(not_taken))


def _materials(every: list[Block]) -> list[_Material]:
    found: list[_Material] = []
    current, component = None, ""
    for block in every:
        if block.keyword == "MATERIAL":
            current, component = _Material(block.parameters.get("NAME", "")), ""
            found.append(current)
            continue
        if current is None:
            continue
        try:
            if block.keyword == "UNIAXIAL":
                component = _component(block, current)
            elif block.keyword == "LOADING DATA" and current.fabric:
                _store(block, current, component)
            elif block.keyword == "FABRIC":
                if "USER" in block.parameters:
                    raise MeshError("USER is a subroutine; give test data")
                current.fabric = True
            elif reason := _OTHERS.get(block.keyword):
                current.not_taken.append(f"*{block.keyword}: {reason}")
            else:
                current = None
        except MeshError as error:
            raise MeshError(f"{block}: {error}") from None
    return found


def _component(block: Block, material: _Material) -> str:
    word = block.parameters.get("COMPONENT", "").upper()
    if word not in _COMPONENTS:
        raise MeshError(
            f"COMPONENT={excerpt(word)} is none of {', '.join(_COMPONENTS)}"
        )
    if _COMPONENTS[word] in material.data:
        raise MeshError(f"COMPONENT={word} is given twice")
    material.data[_COMPONENTS[word]] = []
    return _COMPONENTS[word]


def _store(block: Block, material: _Material, component: str) -> None:
    if not component:
        raise MeshError("comes before *UNIAXIAL")
    parameters = block.parameters
    direction = parameters.get("DIRECTION", "").upper()
    beyond = parameters.get("EXTRAPOLATION", "CONSTANT").upper()
    if direction not in ("", "TENSION", "COMPRESSION"):
        raise MeshError(f"DIRECTION={excerpt(direction)} is not read")
    if beyond not in ("CONSTANT", "LINEAR"):
        raise MeshError(f"EXTRAPOLATION={excerpt(beyond)} is not read")
    kind = parameters.get("TYPE", "ELASTIC").upper()
    if kind != "ELASTIC":
        material.not_taken.append(
            f"{component}, TYPE={excerpt(kind)}: the law is elastic, unloading follows "
            "the loading data"
        )
    rows = [words[:-1] if words[-1] == b"" else words for words in block.data]
    if any(len(row) < 2 for row in rows) or len({len(row) for row in rows}) > 1:
        raise MeshError("each line must have a stress and a strain, and as many words")
    numbers = from_words([word for row in rows for word in row], "f8")
    table = numbers.reshape(len(rows), -1) if rows else np.empty((0, 2))
    if not np.isfinite(table).all():
        raise MeshError("its numbers must be finite")
    if table.shape[1] > 2 and len(table):
        if np.ptp(table[:, 2:], axis=0).any():
            raise MeshError(
                "it depends on temperature, rate or fields; leave the lines of one "
                "value"
            )
        material.not_taken.append(
            f"{component}: temperature, rate or fields of the loading data"
        )
    strain, stress = table[:, 1], table[:, 0]
    if direction == "COMPRESSION" and len(strain) and (strain >= 0).all():
        strain, stress = -strain[::-1], -stress[::-1]
    elif direction == "COMPRESSION" and len(strain) > 1 and strain[0] > strain[-1]:
        strain, stress = strain[::-1], stress[::-1]
    own = material.data[component]
    if any(data.direction in (direction, "") or not direction for data in own):
        raise MeshError("its direction is given twice")
    own.append(_Data(direction, strain, stress, beyond == "LINEAR"))


def _chosen(materials: list[_Material], name: str | None) -> _Material:
    """The material of a name, or the only fabric."""
    fabrics = [m for m in materials if m.fabric]
    if name is not None:
        fabrics = [m for m in fabrics if m.name.upper() == name.upper()]
        if not fabrics:
            raise MeshError(f"it has no *FABRIC in a material {excerpt(name)!r}")
    if not fabrics:
        raise MeshError("it has no *FABRIC")
    if len(fabrics) > 1:
        names = ", ".join(excerpt(m.name) for m in fabrics)
        raise MeshError(f"it has several fabrics ({names}); name one material")
    return fabrics[0]


def _thickness(every: list[Block], material: str) -> float:
    """The thickness of the section of a material."""
    given = {
        block.data[0][0]
        for block in every
        if block.keyword in _SECTIONS
        and block.parameters.get("MATERIAL", "").upper() == material.upper()
        and block.data
    }
    if len(given) == 1:
        (word,) = given
        t = float(from_words([word], "f8")[0])
        if np.isfinite(t) and t > 0:
            return t
        raise MeshError(f"a section has the thickness {t:g}")
    raise MeshError(
        f"{'sections of several thicknesses have' if given else 'no section has'} the "
        f"material {excerpt(material)!r}; state the thickness in mm"
    )


def _law(component: str, data: list[_Data], not_taken: list[str], scale: float) -> Law:
    """The law of a component, from its data in N/mm² times the thickness."""
    if not data:
        raise MeshError(f"it has no *LOADING DATA of {component}")
    try:
        return _law_of(component, data, not_taken, scale)
    except ValueError as error:
        raise MeshError(f"{component}: {error}") from None


def _law_of(
    component: str, data: list[_Data], not_taken: list[str], scale: float
) -> Law:
    both = sorted(data, key=lambda part: part.direction)  # compression comes first
    strain = np.concatenate([part.strain for part in both])
    stress = np.concatenate([part.stress for part in both])
    if any(part.direction for part in both) and not (strain == 0).any():
        at = int(np.searchsorted(strain, 0.0))
        strain, stress = np.insert(strain, at, 0.0), np.insert(stress, at, 0.0)
    if len(both) == 2:  # both state the origin
        keep = np.append(True, ~((np.diff(strain) == 0) & (strain[1:] == 0)))
        strain, stress = strain[keep], stress[keep]
    one_sided = len(strain) and ((strain >= 0).all() or (strain <= 0).all())
    if one_sided and strain[-1] <= 0:
        strain, stress = -strain[::-1], -stress[::-1]
        if both[0].direction == "COMPRESSION":
            raise MeshError("it has data of compression alone")
    if component == "shear":
        x, y = strain, scale * stress
        if not one_sided:  # from fill to warp, where here it is from warp to weft
            x, y = -x[::-1], -y[::-1]
    elif (strain <= -1).any():
        raise MeshError("a nominal strain must be above -1")
    else:
        with np.errstate(over="ignore"):  # infinite values are refused below
            x, y = np.log1p(strain), scale * (1 + strain) * stress
    linear = all(part.linear for part in both)
    if not linear:
        not_taken.append(
            f"{component}: EXTRAPOLATION=CONSTANT; the law ends at the strain "
            f"{strain[-1]:g}, and no state beyond is an answer"
        )
    tension_alone = one_sided and both[0].direction == "TENSION"
    odd = bool(one_sided) and (component == "shear" or not tension_alone)
    if odd and tension_alone:
        not_taken.append("shear: DIRECTION=TENSION; the law holds for both signs")
    law = Tabulated(x, y, "linear" if linear else "refuse", odd)
    if tension_alone and not odd:
        not_taken.append(
            f"{component}: there is no data of compression, so fibres do not resist it"
        )
        return TensionOnly(law)
    return law
