"""Declaration of a case: its tables, their keys, types, defaults and meaning.

Case files, the command line with its help, the validation of input, the written
``case.toml`` and the tables of all keys follow from the structs of this module and of
`scenes`. A key ends with its unit. Each struct builds the object that it declares and
imports the modules for it only then.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from importlib import import_module
from math import degrees, radians
from types import MappingProxyType, NoneType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeAlias,
    Union,
    get_args,
    get_origin,
)

from msgspec import NODEFAULT, Meta, Struct, defstruct, field

from .. import declarations as declared
from ..declarations import REQUIRED, Key
from ..mesh.user_input import MOST_DEGREES

if TYPE_CHECKING:
    from ..fabric.law import Resistance


class Table(Struct, kw_only=True, forbid_unknown_fields=True):
    """Table of a case file."""


def about(text: str) -> Meta:
    """Metadata with the meaning of a key."""
    return Meta(description=text)


#: Metadata of a key whose value is a file name.
FILE = Meta(extra={"file": True})

#: Units of length of files, see `IN_MM`.
LengthUnit: TypeAlias = Literal["mm", "cm", "m", "in"]

Degrees: TypeAlias = Annotated[float, Meta(ge=-MOST_DEGREES, le=MOST_DEGREES)]


class DeclaredTable(Table):
    """Table of the parameters of a class or function.

    Attributes
    ----------
    declaration
        The dataclass of the parameters.
    called
        Name of this class or function.
    keys
        Parameters by their keys in the file, each a name and a `Key`.
    """

    declaration: ClassVar[type[Any]]
    called: ClassVar[str]
    keys: ClassVar[Mapping[str, tuple[str, Key]]] = {}

    def values(self) -> dict[str, Any]:
        """Parameters by name, angles in radians, and tables as pairs."""
        values = {}
        for key, (name, stated) in self.keys.items():
            value = getattr(self, key)
            if stated.unit == "deg" and value is not None:
                value = radians(value)
            elif stated.words:
                value = value == stated.words[True]
            values[name] = tuple(value.items()) if isinstance(value, dict) else value
        return values

    @classmethod
    def implementation(cls) -> Any:
        """The class or function that has the parameters, imported now."""
        module = import_module(f"...{cls.declaration.implemented_in}", __name__)
        return getattr(module, cls.called)

    def construct(self, **others: Any) -> Any:
        """Object of the class or function with the parameters, and with others."""
        return self.implementation()(**{**self.values(), **others})

    @classmethod
    def of(cls, built: Any) -> "DeclaredTable":
        """The table of an object with the parameters."""
        values = {}
        for key, (name, stated) in cls.keys.items():
            value = getattr(built, name)
            if stated.unit == "deg":
                value = degrees(value)
            values[key] = stated.words[value] if stated.words else value
        return cls(**values)


def table_of(
    declaration: type[Any],
    base: type[DeclaredTable] = DeclaredTable,
    tag: str | None = None,
    also: Mapping[str, Any] = MappingProxyType({}),
    last: Sequence[str] = (),
) -> Any:
    """Table of a case file with the keys of declared parameters.

    Parameters
    ----------
    declaration
        The parameters, see `declaration`.
    base
        Base class, with further keys, which come first.
    tag
        Name that selects the table, and of the function; by default, for a class, its
        name in lower case with hyphens.
    also
        Types of further keys of the table, which are None by default.
    last
        Keys and parameters that come last, in their order.
    """
    keys, typed = {}, {name: (name, hint, None) for name, hint in also.items()}
    for parameter in fields(declaration):
        if stated := parameter.metadata.get("key"):
            name = parameter.name
            key = "_".join(filter(None, (stated.name or name, stated.unit)))
            typed[name] = key, *_typed(stated.kind or parameter.type, stated)
            keys[key] = name, stated
    order = sorted(typed, key=lambda name: last.index(name) if name in last else -1)
    return defstruct(
        declaration.__name__,
        [typed[name] for name in order],
        bases=(base,),
        namespace={
            "__doc__": declaration.__doc__,
            "declaration": declaration,
            "called": tag or declaration.__name__,
            "keys": keys,
        },
        module=base.__module__,
        tag=tag or snake_case(declaration).replace("_", "-"),
        kw_only=True,
    )


def _typed(kind: Any, stated: Key) -> tuple[Any, Any]:
    """Type and default of a key."""
    metadata = [about(stated.about), *[FILE] * stated.file]
    default: Any = NODEFAULT if stated.default is REQUIRED else stated.default
    if stated.words:
        kind, default = Literal[stated.words], stated.words[default]
    if get_origin(kind) is dict:
        default = field(default_factory=partial(dict, default))
    if stated.limits is not None:
        metadata.append(Meta(gt=stated.limits[0], le=stated.limits[1]))
    elif stated.unit == "deg":
        kind = Degrees | None if NoneType in get_args(kind) else Degrees
    return Annotated[kind, *metadata], default


def snake_case(kind: type) -> str:
    """Name of a class in lower case, its words separated by underscores."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


def tag_of(table: type[Struct]) -> str:
    """Name that selects a table of a union."""
    return str(table.__struct_config__.tag)


def named(union: Any) -> dict[str, type[Any]]:
    """Tables of a union by name."""
    return {tag_of(table): table for table in get_args(union)}


def summary_of(table: type[Struct]) -> str:
    """First line of the docstring of a table."""
    return (table.__doc__ or "").partition("\n")[0]


#: Number of elements along one side of a generated mesh.
Count: TypeAlias = Annotated[int, Meta(le=1_000_000)]

#: Kinds of meshes that a scene generates.
MESH_KINDS = "graded", "aligned", "irregular", "horizontal", "vertical", "delaunay"


class Mesh(Table):
    """Mesh from a file or generated by the scene."""

    source: Annotated[
        str,
        about(
            f"kind of generated mesh ({', '.join(MESH_KINDS)}), or a file of "
            "quadrilaterals or triangles. graded: triangles along the fibres, small at "
            "singular fibres (default for bias_extension, picture_frame and specimen, "
            "unless size, jitter, seed or directions is given)"
        ),
        FILE,
    ] = "irregular"
    outline: Annotated[
        str | None,
        about(
            "outline of the ply: a drawing (.dxf, .svg), or a table with columns x and "
            "y (.csv), of which a mesh is made; graded for the scene specimen"
        ),
        FILE,
    ] = None
    unit: Annotated[
        LengthUnit | None,
        about("unit of length of the drawing (default: the file's, else mm)"),
    ] = None
    layer: Annotated[
        tuple[str, ...] | None,
        about(
            "layers of the drawing that are read, or id of elements of an .svg "
            "(default: all)"
        ),
    ] = None
    size: Annotated[
        tuple[Count, Count] | None,
        about(
            "number of elements along x and y of a mesh that is not graded, before "
            "they are split"
        ),
    ] = None
    jitter: Annotated[
        float | None,
        about(
            "random displacement of the nodes of a mesh that is not graded, relative "
            "to their spacing"
        ),
    ] = None
    seed: Annotated[int | None, about("seed of the random displacements")] = None
    density: Annotated[
        float | None,
        about("factor of the number of lines of a graded mesh"),
    ] = None
    as_is: Annotated[
        bool,
        about(
            "leave a mesh that is not graded as it is; by default its nodes are moved "
            "and its elements cut where singular fibres cross it"
        ),
    ] = False
    directions: Annotated[
        str | None,
        about(
            "fibre directions of each element: cell data of a .vtu, a .csv, or the "
            "keyword ORIENTATION of an .inp (may be the mesh file)"
        ),
        FILE,
    ] = None


class FabricOfFile(Table):
    """File of all laws, in place of the tables of laws."""

    file: Annotated[
        str | None,
        about(
            "file that contains all laws: a .json of this package, the keyword FABRIC "
            "of an .inp, or LAW58 or LAW158 of a .rad"
        ),
        FILE,
    ] = None
    thickness_mm: Annotated[
        float | None,
        about(
            "thickness of the ply, which converts the stresses of a deck to forces per "
            "width (default: as in the deck)"
        ),
    ] = None
    units: Annotated[str, about("units of force and length of a deck")] = "N mm"
    material: Annotated[
        str | None, about("name of the material, for a deck with several fabrics")
    ] = None
    compression: Annotated[
        Literal["none"] | None,
        about("none: no force of the fibres in compression (default: as in the file)"),
    ] = None
    in_compression: "InCompression | None" = None

    @property
    def changes_compression(self) -> bool:
        """True if the fibres have another law in compression than in the file."""
        return self.compression is not None or self.in_compression is not None

    def compressed(self, law: Any) -> Any:
        """The law of a family of the file, with the behaviour in compression.

        Raises
        ------
        ValueError
            If the law of the file contains one.
        """
        from ..fabric.laws.tension import Asymmetric, Pretensioned, TensionOnly

        if isinstance(law, Pretensioned):
            return replace(law, law=self.compressed(law.law))
        if isinstance(law, Asymmetric | TensionOnly):
            raise ValueError(
                f"fabric.file already contains a law in compression, of "
                f"{type(law).__name__}: omit fabric.compression and "
                "fabric.in_compression, or remove it from the file"
            )
        return _with_compression(law, self.compression or "law", self.in_compression)


# -------------------------------------------------------------------------------- laws


class Law(DeclaredTable, tag_field="law"):
    """Constitutive law of tension T(ε), shear M_s(γ) or bending M(κ)."""

    def build(self, of: "Resistance") -> Any:
        """Build the law; ``of`` is tension, shear or bending."""
        return self.construct()


class Measured(Law, tag="FILE.csv"):
    """a measured law: two columns under a header with units"""

    file: Annotated[str, FILE]
    extrapolation: Annotated[
        Literal["refuse", "linear"],
        about("beyond the table: refuse every state, or extrapolate linearly"),
    ] = "refuse"
    continuation: Annotated[
        Literal["none", "odd"], about(declared.ABOUT_CONTINUATION)
    ] = "none"

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.laws.tabulated import Tabulated

        odd = self.continuation == "odd"
        return Tabulated.from_csv(self.file, self.extrapolation, odd, of)


class LawOfFile(Law, tag="FILE.json"):
    """a law written by `fit` or write_law"""

    file: Annotated[str, FILE]

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.files import read_law
        from ..fabric.law import BiaxialLaw

        law = read_law(self.file)
        biaxial = isinstance(law, BiaxialLaw)
        if getattr(law, "of", None) not in (None, of) or (of != "tension" and biaxial):
            raise ValueError(
                f"{self.file} contains a {type(law).__name__}, which is not a law of "
                f"{of}"
            )
        return law


class CrimpInterchange(Law, tag="crimp-interchange"):
    """crimp interchange between warp and weft: saw-tooth of crimp-toe yarns"""

    stiffness_N_per_mm: Annotated[float, about("stiffness E or G")]
    warp_crimp: Annotated[float, about("crimp c of the warp")]
    weft_crimp: Annotated[float, about("crimp c of the weft")]
    bending_N_per_mm: Annotated[float, about("resistance K to crimp interchange")]
    toe: Annotated[float, about("strain e0")]
    initial_stiffness_N_per_mm: Annotated[
        float, about("stiffness k at rest and in compression")
    ]

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.laws.biaxial import CrimpInterchange

        return CrimpInterchange(
            self.stiffness_N_per_mm,
            (self.warp_crimp, self.weft_crimp),
            bending=self.bending_N_per_mm,
            toe=self.toe,
            initial_stiffness=self.initial_stiffness_N_per_mm,
        )


if TYPE_CHECKING:
    TensionLaw: TypeAlias = Law
    ShearLaw: TypeAlias = Law
    BendingLaw: TypeAlias = Law
else:
    _Linear = table_of(declared.Linear, Law)
    TensionLaw = (
        _Linear
        | Measured
        | table_of(declared.CrimpToe, Law)
        | CrimpInterchange
        | LawOfFile
    )
    ShearLaw = (
        _Linear
        | table_of(declared.Sin2, Law)
        | Measured
        | table_of(declared.Locking, Law)
        | table_of(declared.Polynomial, Law)
        | LawOfFile
    )
    BendingLaw = table_of(declared.Bilinear, Law) | Measured | LawOfFile


class InCompression(Table):
    """Law of the fibres for negative strain."""

    law: TensionLaw


def _with_compression(law: Any, compression: str, other: InCompression | None) -> Any:
    """A law with no force, or another law, in compression."""
    from ..fabric.laws.tension import Asymmetric, TensionOnly

    if other is not None:
        if compression != "law":
            raise ValueError(
                f"compression is {compression!r}, but in_compression is a law: omit "
                "one of them"
            )
        return Asymmetric(law, other.law.build("tension"))
    return TensionOnly(law) if compression == "none" else law


class Weft(Table):
    """Law of the weft, if it differs from the law of the warp."""

    law: TensionLaw
    compression: Annotated[
        Literal["law", "none"],
        about(
            "law: the law also applies in compression; none: no force in compression"
        ),
    ] = "law"
    pretension_N_per_mm: Annotated[float, about("initial tension of the fibres")] = 0.0
    in_compression: InCompression | None = None

    def build(self) -> Any:
        """Build the law of a family.

        Raises
        ------
        ValueError
            If the numbers are invalid, or two keys contradict each other.
        """
        from ..fabric.laws.tension import Pretensioned

        law = self.law.build("tension")
        law = _with_compression(law, self.compression, self.in_compression)
        if self.pretension_N_per_mm:
            return Pretensioned(law, self.pretension_N_per_mm)
        return law


class Tension(Weft):
    """Law of the fibres."""

    weft: Weft | None = None


class Shear(Table):
    """Law of shear."""

    law: ShearLaw
    wrinkling_angle_deg: Annotated[
        float,
        Meta(gt=0, le=90),
        about(
            "shear angle above which compressed fibres wrinkle, for the wrinkle_risk "
            "of a ply on a tool"
        ),
    ] = 90.0


class BendingOfFamily(Table):
    """Bending law of a family, in the place of its stiffness."""

    law: BendingLaw


class Bending(Table):
    """Bending and twist stiffnesses per width of ply."""

    warp_N_mm: Annotated[float, about("bending stiffness of the warp")] = 0.0
    weft_N_mm: Annotated[float, about("bending stiffness of the weft")] = 0.0
    twist_N_mm: Annotated[float, about("twist stiffness")] = 0.0
    warp_law: BendingOfFamily | None = None
    weft_law: BendingOfFamily | None = None

    def build(self) -> tuple[Any, Any]:
        """Stiffness or law of warp and weft; an error if a family has both."""
        return self._of("warp"), self._of("weft")

    def _of(self, family: str) -> Any:
        D, table = getattr(self, f"{family}_N_mm"), getattr(self, f"{family}_law")
        if table and D:
            raise ValueError(f"{family}_N_mm: {family}_law is a law: omit one of them")
        return table.law.build("bending") if table else D


class Region(Table):
    """Properties of a subdomain of the mesh that differ from the ply."""

    warp_deg: Annotated[
        Degrees | None, about("inclination of the warp (default: as in the scene)")
    ] = None
    weft_deg: Annotated[
        Degrees | None, about("inclination of the weft (default: as in the scene)")
    ] = None
    tension: Tension | None = None
    shear: Shear | None = None
    bending: Bending | None = None


# ------------------------------------------------------------------------ formulations


class FormulationTable(DeclaredTable, tag_field="name"):
    """Elements and their stabilisation."""


class Auto(FormulationTable, tag="auto"):
    """quadratic, or macro on a mesh that singular fibres cross"""

    def construct(self, **others: Any) -> None:
        """None; `fitted` chooses the formulation."""


if TYPE_CHECKING:
    AnyFormulation: TypeAlias = FormulationTable
else:
    AnyFormulation = Union[  # noqa: UP007 - of a sequence
        Auto,
        table_of(declared.OnePoint, FormulationTable, last=["stabilisation"]),
        table_of(declared.Macro, FormulationTable),
        table_of(declared.Full, FormulationTable),
        table_of(declared.Quadratic, FormulationTable),
    ]

# ---------------------------------------------------------------------------- the rest


class Loads(Table):
    """Loads in addition to the conditions of the scene."""

    force_N: Annotated[
        dict[str, Annotated[tuple[float, ...], Meta(min_length=2, max_length=3)]],
        about(
            "total force on a boundary along x and y (and z in space), proportional "
            "to the load factor"
        ),
    ] = field(default_factory=dict)
    weight_N_per_mm2: Annotated[
        Annotated[tuple[float, ...], Meta(min_length=2, max_length=3)] | None,
        about(
            "weight of the ply per area at rest along x and y (and z in space), there "
            "from the start, such as [0, 0, -6e-6] for 0.6 kg/m2"
        ),
    ] = None


Check: TypeAlias = Literal[
    "folding",
    "crease",
    "strain",
    "stability",
    "work",
    "stabilisation",
    "deviation",
    "corners",
    "surface",
    "slack",
]


class Stepping(Table):
    """Load steps and solvers."""

    steps: Annotated[int, about("number of load steps")] = 20
    tolerance: Annotated[
        float | None,
        about(
            "make the mesh finer until the half-width of the error interval, relative "
            "to the load, is below this value"
        ),
    ] = None
    most_unknowns: Annotated[
        int, about("largest number of unknowns of a mesh in a run with a tolerance")
    ] = 50_000
    method: Annotated[
        Literal["newton", "plain"],
        about(
            "newton: for large steps; plain: Newton's method with the consistent "
            "tangent, for small steps"
        ),
    ] = "newton"
    warn_only: Annotated[
        tuple[Check, ...], about("checks that warn instead of rejecting a state")
    ] = ("work", "stabilisation", "deviation", "corners", "surface", "slack")
    solver: Annotated[
        Literal["auto", "rslab", "cholmod", "pardiso", "superlu"],
        about(
            "linear solver: cholmod requires cvxopt, pardiso requires pypardiso; auto "
            "selects the fastest of those that are installed"
        ),
    ] = "auto"


#: Kinds of files of flat patterns.
PatternKind: TypeAlias = Literal["csv", "svg", "dxf"]
PATTERN_KINDS: tuple[str, ...] = get_args(PatternKind)


class Output(Table):
    """Files in addition to the results of a run."""

    pictures: Annotated[bool, about("draw pictures")] = True
    test_curve: Annotated[
        str | None,
        about("CSV file with a test curve, drawn with the curve of the run"),
        FILE,
    ] = None
    part_mesh: Annotated[
        str | None,
        about("mesh of the part, to whose elements the fibre directions are mapped"),
        FILE,
    ] = None
    deck: Annotated[
        str | None,
        about(
            "deck of the part (Abaqus, CalculiX, Nastran, LS-DYNA, OpenRadioss), of "
            "which a copy with the layers of the ply is written into the folder deck"
        ),
        FILE,
    ] = None
    thickness_mm: Annotated[
        Annotated[float, Meta(gt=0)] | None,
        about("thickness of the flat ply, for a deck"),
    ] = None
    material: Annotated[
        str | None,
        about(
            "name or number of the material of the layers (default: the material "
            "of the sections in the deck)"
        ),
    ] = None
    calculix: Annotated[
        bool, about("write an .inp deck for CalculiX too, as NAME_ccx.inp")
    ] = False
    part_reach_mm: Annotated[
        Annotated[float, Meta(gt=0)] | None,
        about(
            "largest distance between the centre of an element of the part and the ply "
            "on it (default: a quarter of the longest edge of both)"
        ),
    ] = None
    trim: Annotated[
        tuple[str, ...] | str | None,
        about(
            "tables with columns x, y and z, or DXF files, of closed curves that trim "
            "the flat pattern: the outline, then holes (default: the boundary of the "
            "part)"
        ),
        FILE,
    ] = None
    pattern: Annotated[
        tuple[PatternKind, ...] | None,
        about(
            "kinds of files of the flat pattern: csv, svg, dxf (default: all that can "
            "be written)"
        ),
    ] = None
