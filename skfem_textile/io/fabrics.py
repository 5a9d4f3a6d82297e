"""Input and output of fabrics; `*FABRIC` of Abaqus: test data of fill, warp and shear.

Abaqus uses nominal stress over nominal strain along the yarns, and shear stress over
the decrease of the angle between them, each energy-conjugate per reference volume
("Fabric material behavior" in the Analysis User's Guide).  With the thickness t and the
strain e the tension is T(ln(1 + e)) = t (1 + e) σ(e), and the moment M = t τ.
"""

import logging
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..fabric import Fabric, Law, Linear, Tabulated, TensionOnly, TwoLaws
from ..fabric.catalogue import catalogue as catalogue
from ..fabric.catalogue import file_of
from ..fabric.files import fabric_of_text, fabric_text
from ..fabric.law import domain_of
from ..fabric.origin import Origin
from ..mesh.checks import MeshError
from ..mesh.user_input import errors_in, excerpt, printable
from . import radioss
from .abaqus import Block, blocks, content_of, without_trailing_comma
from .directions import directions_of_deck
from .file_numbers import errors_about, from_words

log = logging.getLogger(__name__)

# Suffixes of fabric files.
_SUFFIXES = (".json", ".inp", ".rad")

# Units in N or mm.
_FORCES = {"N": 1.0, "kN": 1e3}
_LENGTHS = {"mm": 1.0, "cm": 10.0, "m": 1e3}


class FabricOfFile(NamedTuple):
    """Fabric read from a file, and messages about ignored data.

    ``fabric`` has laws in N/mm, and directions if the file defines them.  ``ignored``
    has one message per ignored feature of the file.  ``origin`` states the sources and
    the laws of single specimens; None if the file does not contain them.
    """

    fabric: Fabric
    ignored: tuple[str, ...]
    origin: Origin | None = None

    def samples(self, n: int, seed: int = 1) -> list[Fabric]:
        """Fabrics with the random laws of n further specimens.

        Parameters
        ----------
        n
            Number of samples.  The first ones of a larger n are the same.
        seed
            Seed of the random numbers.

        Raises
        ------
        ValueError
            If the file contains the laws of fewer than three specimens, or a law of a
            specimen is not positive.

        Examples
        --------
        >>> one, two = read_fabric("cao2008-plain-weave").samples(2)
        >>> one.shear_law.value(np.array([0.5])).round(4).item()
        0.0106
        """
        from ..fabric.scatter import sampled

        return sampled(self.fabric, self.origin, n, seed)


def read_fabric(
    path: str | os.PathLike[str],
    thickness: float | None = None,
    units: str = "N mm",
    material: str | None = None,
) -> FabricOfFile:
    """Read a fabric of the catalogue, or a .json, Abaqus .inp or OpenRadioss .rad file.

    A warning in the log ``skfem_textile`` reports each ignored feature.

    Parameters
    ----------
    path
        The file, or a name of `catalogue`.
    thickness
        Thickness of the ply in mm, which converts stress to force per width.  By
        default the thickness of the section of the material in an Abaqus deck.
    units
        Units of force and length in a deck.
    material
        Name, or number in OpenRadioss, of the material, if there are several.

    Returns
    -------
    FabricOfFile
        The fabric, and messages about ignored data.

    Raises
    ------
    MeshError
        If the file cannot be read or does not contain a fabric; one line names the
        file.

    Examples
    --------
    >>> write_fabric("fabric.json", Fabric(1e4, 0.5, warp=(1, 1), weft=(-1, 1)))
    >>> read_fabric("fabric.json").fabric.families[0].tension
    Linear(stiffness=10000.0)
    >>> read_fabric("cao2008-plain-weave").origin.sources["shear"][:40]
    'polynomial of degree 5, fitted to the fo'
    """
    with errors_in("", MeshError):
        path = file_of(path)
    with errors_about(path):
        result = _read(path, thickness, units, material)
    for sentence in result.ignored:
        log.warning("%s: not represented exactly: %s", printable(path), sentence)
    return result


def _read(
    path: Path, thickness: float | None, units: str, material: str | None
) -> FabricOfFile:
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise MeshError(f"fabrics can be read only from {', '.join(_SUFFIXES)} files")
    force, length = _units(units)
    if thickness is not None and not (np.isfinite(thickness) and thickness > 0):
        raise MeshError(f"the thickness must be positive, got {thickness} mm")
    content = content_of(path)
    if suffix == ".json":
        if thickness is not None or material is not None:
            raise MeshError(
                "a .json file does not need a thickness or a material: omit them"
            )
        fabric, origin = fabric_of_text(content)
        return FabricOfFile(fabric, (), origin)
    stress = force / length**2
    if suffix == ".rad":
        fabric, ignored = radioss.read(content, thickness, stress, material)
    else:
        fabric, ignored = _of_abaqus(content, thickness, length, stress, material)
        if directions := directions_of_deck(content):
            fabric = replace(fabric, warp=directions[0], weft=directions[1])
    return FabricOfFile(fabric, tuple(ignored))


def _units(words: str) -> tuple[float, float]:
    """Units of force and length of a deck, in N and mm."""
    force, _, length = words.strip().partition(" ")
    length = length.strip()
    if force not in _FORCES or length not in _LENGTHS:
        raise MeshError(
            f"units must be a force ({', '.join(_FORCES)}) and a length "
            f"({', '.join(_LENGTHS)}), such as 'N mm', got {words!r}"
        )
    return _FORCES[force], _LENGTHS[length]


def write_fabric(
    path: str | os.PathLike[str],
    fabric: Fabric,
    thickness: float | None = None,
    name: str = "FABRIC",
    origin: Origin | None = None,
) -> None:
    """Write a fabric, lossless to .json or as an Abaqus material to .inp.

    A .inp contains only the laws, in N and mm; a law that is not tabulated is written
    as 1001 points, up to a strain of 0.1 or an angle of 80°.  Directions are written by
    `write_directions`.

    Parameters
    ----------
    path
        The file.
    fabric
        The fabric.
    thickness
        Thickness of the ply in mm, for a .inp.
    name
        Name of the material in a .inp.
    origin
        Origin of the laws, for a .json.

    Raises
    ------
    ValueError
        If the format cannot express the fabric, a thickness is missing, or the name
        has another suffix.
    OSError
        If the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".json":
        text = fabric_text(fabric, origin)
    elif suffix != ".inp":
        raise ValueError(f"{path}: fabrics can be written only to .json, .inp files")
    elif thickness is None or not (np.isfinite(thickness) and thickness > 0):
        raise ValueError(
            f"{path}: *FABRIC requires the thickness of the ply in mm, got {thickness}"
        )
    else:
        text = _material_of(fabric, thickness, name)
    path.write_text(text, encoding="utf-8")


# Components of *UNIAXIAL and their meaning here: the first yarns are the fill.
_COMPONENTS = {"1": "weft", "2": "warp", "SHEAR": "shear"}

_SECTIONS = ("SHELL SECTION", "MEMBRANE SECTION")

# Other material options, and reasons why they have no counterpart.
_OTHERS = {
    "DENSITY": "the ply is in static equilibrium",
    "DAMPING": "the ply is in static equilibrium",
    "EXPANSION": "temperature is not modelled",
    "UNLOADING DATA": "laws are elastic: unloading follows the loading data",
    "DEPVAR": "laws have no internal variables",
    "ELASTIC": "the fabric has only the laws of *FABRIC",
    "PLASTIC": "laws are elastic",
    "VISCOELASTIC": "laws are independent of time",
    "DAMAGE INITIATION": "laws are elastic",
    "DAMAGE EVOLUTION": "laws are elastic",
    "FAIL STRAIN": "material failure is not modelled",
    "FAIL STRESS": "material failure is not modelled",
    "SPECIFIC HEAT": "temperature is not modelled",
    "CONDUCTIVITY": "temperature is not modelled",
}

# Supported parameters, by keyword of a fabric.
_PARAMETERS = {
    "FABRIC": {"USER"},
    "UNIAXIAL": {"COMPONENT"},
    "LOADING DATA": {"TYPE", "DIRECTION", "EXTRAPOLATION", "DEPENDENCIES"},
}

#: Names for ``others`` of `read_mesh`, of data that `read_fabric` reads or reports.
OF_FABRICS = tuple(
    f"*{keyword}" for keyword in ("MATERIAL", *_PARAMETERS, *_SECTIONS, *_OTHERS)
)


class _Data(NamedTuple):
    """Loading data of one direction: strains, stresses, and extrapolation."""

    direction: str
    strain: ndarray
    stress: ndarray
    linear: bool


@dataclass
class _Material:
    """Material with *FABRIC: loading data by component, and ignored keywords."""

    name: str
    fabric: bool = False
    data: dict[str, list[_Data]] = field(default_factory=dict)
    ignored: list[str] = field(default_factory=list)


def _of_abaqus(
    content: bytes,
    thickness: float | None,
    length: float,
    stress: float,
    material: str | None,
) -> tuple[Fabric, list[str]]:
    """Fabric of a deck, and messages about ignored data.

    ``length`` and ``stress`` are the units of the deck in mm and N/mm².

    Raises
    ------
    MeshError
        If the deck violates its format, or has no such fabric or no thickness.
    """
    every = list(blocks(content))
    chosen = _chosen(_materials(every), material)
    if thickness is None:
        thickness = length * _thickness(every, chosen.name)
    ignored, laws = chosen.ignored, []
    for component in ("warp", "weft", "shear"):
        with errors_about(component):
            data = chosen.data.get(component)
            if not data:
                raise MeshError("the component has no *LOADING DATA")
            laws.append(_law(component, data, ignored, thickness * stress))
    warp, weft, shear = laws
    ignored.append(
        "Abaqus interpolates the data linearly; the laws here interpolate the same "
        "points with a monotone cubic"
    )
    return Fabric((warp, weft), shear), ignored


def _materials(every: list[Block]) -> list[_Material]:
    materials: list[_Material] = []
    current, component = None, ""
    for block in every:
        if block.keyword == "MATERIAL":
            current, component = _Material(block.parameters.get("NAME", "")), ""
            materials.append(current)
            continue
        if current is None:
            continue
        with errors_about(block):
            current.ignored += _unread_parameters(block)
            if block.keyword == "UNIAXIAL":
                component = _component(block, current)
            elif block.keyword == "LOADING DATA" and current.fabric:
                _store(block, current, component)
            elif block.keyword == "FABRIC":
                if "USER" in block.parameters:
                    raise MeshError(
                        "the parameter USER, a user subroutine, is not supported: "
                        "provide *LOADING DATA"
                    )
                current.fabric = True
            elif reason := _OTHERS.get(block.keyword):
                current.ignored.append(f"*{block.keyword}: {reason}")
            else:
                current = None
    return materials


def _unread_parameters(block: Block) -> list[str]:
    """Messages about the parameters of a keyword of a fabric that are not read."""
    known = _PARAMETERS.get(block.keyword, block.parameters.keys())
    words = [
        "=".join(filter(None, (name, block.parameters[name])))
        for name in sorted(block.parameters.keys() - known)
    ]
    return [
        f"*{block.keyword}, {excerpt(word)}: this parameter is ignored"
        for word in words
    ]


def _component(block: Block, material: _Material) -> str:
    word = block.parameters.get("COMPONENT", "").upper()
    if word not in _COMPONENTS:
        raise MeshError(
            f"COMPONENT={excerpt(word)} must be one of {', '.join(_COMPONENTS)}"
        )
    if _COMPONENTS[word] in material.data:
        raise MeshError(f"COMPONENT={word} is defined twice: keep one of them")
    material.data[_COMPONENTS[word]] = []
    return _COMPONENTS[word]


def _store(block: Block, material: _Material, component: str) -> None:
    if not component:
        raise MeshError("this keyword must follow *UNIAXIAL")
    parameters = block.parameters
    direction = _choice(parameters, "DIRECTION", "", "TENSION", "COMPRESSION")
    beyond = _choice(parameters, "EXTRAPOLATION", "CONSTANT", "LINEAR")
    kind = parameters.get("TYPE", "ELASTIC").upper()
    if kind != "ELASTIC":
        material.ignored.append(
            f"{component}, TYPE={excerpt(kind)}: the law is elastic, and unloading "
            "follows the loading data"
        )
    rows = [without_trailing_comma(words) for words in block.data]
    if any(len(row) < 2 for row in rows) or len({len(row) for row in rows}) > 1:
        raise MeshError(
            "each line must begin with a stress and a strain, and all lines must have "
            "the same number of values"
        )
    numbers = from_words([word for row in rows for word in row], "f8")
    table = numbers.reshape(len(rows), -1) if rows else np.empty((0, 2))
    if not np.isfinite(table).all():
        raise MeshError("all numbers must be finite")
    if table.shape[1] > 2 and len(table):
        if np.ptp(table[:, 2:], axis=0).any():
            raise MeshError(
                "the data depend on temperature, rate or fields: keep the lines of one "
                "value"
            )
        material.ignored.append(
            f"{component}: temperature, rate and fields of the loading data are ignored"
        )
    strain, stress = table[:, 1], table[:, 0]
    if direction == "COMPRESSION" and len(strain) and (strain >= 0).all():
        strain, stress = -strain[::-1], -stress[::-1]
    elif direction == "COMPRESSION" and len(strain) > 1 and strain[0] > strain[-1]:
        strain, stress = strain[::-1], stress[::-1]
    tables = material.data[component]
    if any(data.direction in (direction, "") or not direction for data in tables):
        raise MeshError("the data of one direction are defined twice: keep one of them")
    tables.append(_Data(direction, strain, stress, beyond == "LINEAR"))


def _choice(parameters: dict[str, str], key: str, *choices: str) -> str:
    """Value of a parameter, by default the first choice."""
    given = parameters.get(key, choices[0]).upper()
    if given not in choices:
        known = " or ".join(filter(None, choices))
        raise MeshError(f"{key}={excerpt(given)} is not supported: use {known}")
    return given


def _chosen(materials: list[_Material], name: str | None) -> _Material:
    """Material with a name, or the only fabric."""
    fabrics = [m for m in materials if m.fabric]
    if name is not None:
        fabrics = [m for m in fabrics if m.name.upper() == name.upper()]
    if not fabrics:
        wanted = f"material {excerpt(name)!r} with *FABRIC" if name else "*FABRIC"
        raise MeshError(f"the file contains no {wanted}")
    if len(fabrics) > 1:
        names = ", ".join(excerpt(m.name) for m in fabrics)
        raise MeshError(
            f"the file contains several fabrics ({names}): specify the material"
        )
    return fabrics[0]


def _thickness(every: list[Block], material: str) -> float:
    """Thickness of the section of a material."""
    values = {
        block.data[0][0]
        for block in every
        if block.keyword in _SECTIONS
        and block.parameters.get("MATERIAL", "").upper() == material.upper()
        and block.data
    }
    if len(values) != 1:
        found = "sections of several thicknesses have" if values else "no section has"
        raise MeshError(
            f"{found} the material {excerpt(material)!r}: specify the thickness in mm"
        )
    t = from_words(list(values), "f8").item()
    if not (np.isfinite(t) and t > 0):
        raise MeshError(f"the thickness of the section must be positive, got {t:g}")
    return t


def _law(component: str, data: list[_Data], ignored: list[str], scale: float) -> Law:
    """Law of a component, from its data in N/mm² times the thickness."""
    both = sorted(data, key=lambda part: part.direction)  # compression comes first
    strain = np.concatenate([part.strain for part in both])
    stress = np.concatenate([part.stress for part in both])
    if any(part.direction for part in both) and not (strain == 0).any():
        at = int(np.searchsorted(strain, 0.0))
        strain, stress = np.insert(strain, at, 0.0), np.insert(stress, at, 0.0)
    if len(both) == 2:  # both contain the origin
        keep = np.append(True, ~((np.diff(strain) == 0) & (strain[1:] == 0)))
        strain, stress = strain[keep], stress[keep]
    one_sided = len(strain) and ((strain >= 0).all() or (strain <= 0).all())
    if one_sided and strain[-1] <= 0:
        strain, stress = -strain[::-1], -stress[::-1]
        if both[0].direction == "COMPRESSION":
            raise MeshError("the component has only compression data: add tension data")
    if component == "shear":
        x, y = strain, scale * stress
        if not one_sided:  # from fill to warp, but here from warp to weft
            x, y = -x[::-1], -y[::-1]
    elif (strain <= -1).any():
        raise MeshError(f"every nominal strain must be above -1, got {strain.min():g}")
    else:
        with np.errstate(over="ignore"):  # infinite values are refused below
            x, y = np.log1p(strain), scale * (1 + strain) * stress
    linear = all(part.linear for part in both)
    if not linear:
        ignored.append(
            f"{component}: EXTRAPOLATION=CONSTANT: the law ends at the strain "
            f"{strain[-1]:g}, and states beyond it are refused"
        )
    tension_alone = one_sided and both[0].direction == "TENSION"
    odd = bool(one_sided) and (component == "shear" or not tension_alone)
    if odd and tension_alone:
        ignored.append("shear: DIRECTION=TENSION: the law is used for both signs")
    law = Tabulated(x, y, "linear" if linear else "refuse", odd)
    if tension_alone and not odd:
        ignored.append(
            f"{component}: there are no compression data, so that fibres do not resist "
            "compression"
        )
        return TensionOnly(law)
    return law


# Number of points of a law that is not tabulated: linear interpolation of a parabola
# then has an error of a millionth of its largest value.
_N_POINTS = 1001

# Strain and angle up to which laws with an unbounded domain are written.
_STRAIN, _ANGLE = 0.1, np.radians(80.0)

# Components in the order of Abaqus: fill, warp, shear.
_WRITTEN_COMPONENTS = (("1", 1), ("2", 0), ("SHEAR", 2))


def _material_of(fabric: Fabric, thickness: float, name: str) -> str:
    """Abaqus material with the laws of a fabric; an error if it cannot be expressed."""
    unsupported = {
        "a law of both fibre strains": not isinstance(fabric.tensions, TwoLaws),
        "bending or twist stiffness": fabric.bends,
        "a wrinkling angle": np.any(fabric.wrinkling_angle != Fabric.wrinkling_angle),
        "yarns": fabric.yarns is not None,
        "laws that differ between elements": fabric.at() is not fabric,
    }
    for what, is_given in unsupported.items():
        if is_given:
            raise ValueError(f"*FABRIC does not support {what}: write a .json file")
    lines = [f"*MATERIAL, NAME={name}", "*FABRIC"]
    for word, number in _WRITTEN_COMPONENTS:
        lines.append(f"*UNIAXIAL, COMPONENT={word}")
        lines += _written_component(fabric.laws[number], word == "SHEAR", thickness)
    return "\n".join([*lines, ""])


def _written_component(law: Law, shear: bool, thickness: float) -> Iterator[str]:
    inner, tension = law, ""
    if isinstance(law, TensionOnly):
        inner, tension = law.law, ", DIRECTION=TENSION"
    x, y, beyond = _points(inner, _ANGLE if shear else _STRAIN)
    if tension:
        y = np.where(x < 0, 0.0, y)
        x, y = x[x >= 0], y[x >= 0]
    if shear:
        strain, stress = -x[::-1], -y[::-1] / thickness
    else:
        strain, stress = np.expm1(x), y / (thickness * np.exp(x))
    yield f"*LOADING DATA, TYPE=ELASTIC{tension}{beyond}"
    for s, e in zip(stress.tolist(), strain.tolist(), strict=True):
        yield f"{s!r}, {e!r}"


def _points(law: Any, reach: float) -> tuple[ndarray, ndarray, str]:
    """Arguments and values of a law, and the extrapolation for Abaqus."""
    if isinstance(law, Tabulated):
        x, y = law.points
        beyond = ", EXTRAPOLATION=LINEAR" if law.extrapolation == "linear" else ""
        return x, y, beyond
    if isinstance(law, Linear):
        x = np.array([-reach, 0.0, reach])
        return x, law.value(x), ", EXTRAPOLATION=LINEAR"
    ends = domain_of(law)
    if np.isfinite(ends).any():  # as there may be a pole
        ends = getattr(law, "shown", None) or ends
    low, high = max(float(ends[0]), -reach), min(float(ends[1]), reach)
    x = np.linspace(low, high, _N_POINTS)
    x[np.abs(x).argmin()] = 0.0
    return x, law.value(x), ""
