"""The declaration of a case: its tables, their keys, types, defaults and meaning.

Case files, the command line with its help, the checks of what a user gives, the written
``case.toml`` and the tables of all keys follow from the structs of this module and of
`scenes`.  A key ends with its unit.  Each struct builds the object that it declares,
and imports what that needs only then.
"""

from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, get_args

import numpy as np
from msgspec import Meta, field

from .scenes import AnyScene
from .table import FILE, Degrees, Table, about

if TYPE_CHECKING:
    from ..fabric.law import Resistance
    from ..ply.terms import Formulation

MeshKind: TypeAlias = Literal[
    "aligned", "irregular", "horizontal", "vertical", "delaunay"
]

#: A number of elements that a mesh to make may have along one side.
Count: TypeAlias = Annotated[int, Meta(le=1_000_000)]

#: Kinds of meshes that a scene makes itself.
MESH_KINDS: tuple[str, ...] = get_args(MeshKind)


class Mesh(Table):
    """The mesh, of a file or made by the scene."""

    source: Annotated[
        str,
        about(f"{', '.join(MESH_KINDS)}, or a file of quadrilaterals or triangles"),
        FILE,
    ] = "irregular"
    size: Annotated[
        tuple[Count, Count] | None,
        about("elements along x and y of a mesh to make, before they are split"),
    ] = None
    jitter: Annotated[
        float | None, about("random displacement of its nodes over their spacing")
    ] = None
    seed: Annotated[int | None, about("seed of these displacements")] = None
    directions: Annotated[
        str | None,
        about(
            "fibre directions of each element: cell data of a .vtu, a .csv, or the "
            "keyword ORIENTATION of an .inp, which may be the mesh file"
        ),
        FILE,
    ] = None


class FabricOfFile(Table):
    """A file of all laws, in place of the tables of laws."""

    file: Annotated[
        str | None,
        about(
            "all laws: a .json of the package, the keyword FABRIC of an .inp, or LAW58 "
            "or LAW158 of a .rad"
        ),
        FILE,
    ] = None
    thickness_mm: Annotated[
        float | None,
        about("thickness of the ply, for the stresses of a deck (default: its own)"),
    ] = None
    units: Annotated[str, about("force and length of a deck")] = "N mm"
    material: Annotated[str | None, about("name in a deck with several fabrics")] = None


# -------------------------------------------------------------------------------- laws


class Law(Table, tag_field="law"):
    """A constitutive law of tension T(ε) or shear M_s(γ)."""

    def build(self, of: "Resistance") -> Any:
        """The law; ``of`` tells tension from shear."""
        raise NotImplementedError


Stiffness: TypeAlias = Annotated[float, about("stiffness E or G")]

Continuation: TypeAlias = Annotated[
    Literal["none", "odd"],
    about("odd: given for arguments >= 0, with the sign of the value turned below"),
]


class Linear(Law, tag="linear"):
    """M_s = G gamma, or T = E eps"""

    stiffness_N_per_mm: Stiffness

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.law import Linear

        return Linear(self.stiffness_N_per_mm)


class Measured(Law, tag="FILE.csv"):
    """a measured law, two columns under a header with units"""

    file: Annotated[str, FILE]
    extrapolation: Annotated[
        Literal["refuse", "linear"],
        about("beyond the table: refuse every state, or go on in a straight line"),
    ] = "refuse"
    continuation: Continuation = "none"

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.laws.tabulated import Tabulated

        odd = self.continuation == "odd"
        return Tabulated.from_csv(self.file, self.extrapolation, odd, of)


class LawOfFile(Law, tag="FILE.json"):
    """a law as `fit` or write_law writes it"""

    file: Annotated[str, FILE]

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.files import read_law
        from ..fabric.law import BiaxialLaw

        law = read_law(self.file)
        biaxial = isinstance(law, BiaxialLaw)
        if getattr(law, "of", None) not in (None, of) or (of == "shear" and biaxial):
            raise ValueError(f"{type(law).__name__} is not a law of {of}")
        return law


class CrimpToe(Law, tag="crimp-toe"):
    """T = E (eps - e0 (1 - exp(-eps/e0))) + k eps, k eps in compression"""

    stiffness_N_per_mm: Stiffness
    toe: Annotated[float, about("strain e0")]
    initial_stiffness_N_per_mm: Annotated[
        float, about("stiffness k at rest and in compression")
    ]

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.laws.tension import CrimpToe

        return CrimpToe(
            self.stiffness_N_per_mm, self.toe, self.initial_stiffness_N_per_mm
        )


class CrimpInterchange(Law, tag="crimp-interchange"):
    """warp and weft that exchange crimp, a saw-tooth of yarns of crimp-toe"""

    stiffness_N_per_mm: Stiffness
    warp_crimp: Annotated[float, about("crimp c of the warp, a ratio")]
    weft_crimp: Annotated[float, about("crimp c of the weft, a ratio")]
    bending_N_per_mm: Annotated[float, about("resistance K to an exchange of crimp")]
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


class Sin2(Law, tag="sin2"):
    """w = G sin^2 gamma / 2"""

    stiffness_N_per_mm: Stiffness

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.laws.shear import Sin2

        return Sin2(self.stiffness_N_per_mm)


class Locking(Law, tag="locking"):
    """M_s = G gamma / (1 - (gamma/a)^2)"""

    stiffness_N_per_mm: Stiffness
    locking_angle_deg: Annotated[
        float, Meta(gt=0, le=90), about("angle a, where the law has a pole")
    ]

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.laws.shear import Locking

        angle = float(np.radians(self.locking_angle_deg))
        return Locking(self.stiffness_N_per_mm, angle)


class Polynomial(Law, tag="polynomial"):
    """M_s = c1 s + c2 s^2 + ..., s = gamma or sin gamma"""

    coefficients_N_per_mm: Annotated[tuple[float, ...], about("c1, c2, ...")]
    variable: Annotated[
        Literal["angle", "sine"], about("s: the angle in radians or its sine")
    ] = "angle"
    continuation: Continuation = "none"

    def build(self, of: "Resistance") -> Any:
        """See `Law.build`."""
        from ..fabric.laws.polynomial import Polynomial

        sine, odd = self.variable == "sine", self.continuation == "odd"
        return Polynomial(self.coefficients_N_per_mm, sine, odd)


TensionLaw: TypeAlias = Linear | Measured | CrimpToe | CrimpInterchange | LawOfFile

ShearLaw: TypeAlias = Linear | Sin2 | Measured | Locking | Polynomial | LawOfFile


class InCompression(Table):
    """The law of the fibres for negative strain."""

    law: TensionLaw


class Weft(Table):
    """The law of the weft, where it differs from the law of the warp."""

    law: TensionLaw
    compression: Annotated[
        Literal["law", "none"],
        about("in compression: what the law says, or no force at all"),
    ] = "law"
    pretension_N_per_mm: Annotated[float, about("tension of the fibres at rest")] = 0.0
    in_compression: InCompression | None = None

    def build(self) -> Any:
        """The law of a family.

        Raises
        ------
        ValueError
            If its numbers make no law, or two keys contradict each other.
        """
        from ..fabric.laws.tension import Asymmetric, Pretensioned, TensionOnly

        law = self.law.build("tension")
        if self.in_compression is not None:
            if self.compression != "law":
                raise ValueError(
                    f"compression is {self.compression!r}, but in_compression is a law:"
                    " leave one of them out"
                )
            law = Asymmetric(law, self.in_compression.law.build("tension"))
        elif self.compression == "none":
            law = TensionOnly(law)
        if self.pretension_N_per_mm:
            return Pretensioned(law, self.pretension_N_per_mm)
        return law


class Tension(Weft):
    """The law of the fibres."""

    weft: Weft | None = None


class Shear(Table):
    """The law of shear."""

    law: ShearLaw
    wrinkling_angle_deg: Annotated[
        float,
        Meta(gt=0, le=90),
        about(
            "shear angle past which fibres wrinkle as soon as they are compressed, for "
            "the wrinkle_risk of a ply on a tool"
        ),
    ] = 90.0


class Bending(Table):
    """Stiffnesses against bending and twist, per width of ply."""

    warp_N_mm: Annotated[float, about("bending stiffness of the warp")] = 0.0
    weft_N_mm: Annotated[float, about("bending stiffness of the weft")] = 0.0
    twist_N_mm: Annotated[float, about("twist stiffness")] = 0.0


class Region(Table):
    """What differs in a subdomain of the mesh."""

    warp_deg: Annotated[
        Degrees | None, about("inclination of the warp (default: the scene's)")
    ] = None
    weft_deg: Annotated[
        Degrees | None, about("inclination of the weft (default: the scene's)")
    ] = None
    tension: Tension | None = None
    shear: Shear | None = None
    bending: Bending | None = None


# ------------------------------------------------------------------------ formulations


class FormulationTable(Table, tag_field="name"):
    """The elements and how they are stabilised."""

    def build(self) -> "Formulation":
        """The formulation."""
        raise NotImplementedError


Stabilisation: TypeAlias = Annotated[
    float | Literal["auto"],
    about(
        "stabilisation stiffness C_s, or auto: by shear stiffness, tension and angle "
        "of the fibres of each element, 1e-4 E without shear stiffness"
    ),
]


class Macro(FormulationTable, tag="macro"):
    """macro-elements, nothing to tune"""

    cs_N_per_mm: Stabilisation = "auto"

    def build(self) -> "Formulation":
        """See `FormulationTable.build`."""
        from ..ply.formulations import Macro

        return Macro(self.cs_N_per_mm)


class OnePoint(FormulationTable, tag="one-point"):
    """the paper's element, one stabilised point in every quadrilateral"""

    stabilisation: Annotated[
        Literal["energy", "rate", "continuity", "isotropic"],
        about(
            "independent of the path, the paper's rates, by jumps between elements, or "
            "isotropic; the last three need a number C_s"
        ),
    ] = "energy"
    cs_N_per_mm: Stabilisation = "auto"

    def build(self) -> "Formulation":
        """See `FormulationTable.build`."""
        from ..ply.formulations import OnePoint

        return OnePoint(self.cs_N_per_mm, self.stabilisation)


class Full(FormulationTable, tag="full"):
    """2x2 points in every quadrilateral"""

    def build(self) -> "Formulation":
        """See `FormulationTable.build`."""
        from ..ply.formulations import Full

        return Full()


class Quadratic(FormulationTable, tag="quadratic"):
    """quadratic triangles, for which quadrilaterals are cut along a diagonal"""

    deviation: Annotated[
        float | None,
        about(
            "if given, triangles have the tension of their mean stretch, and "
            "deviations from it meet this multiple of shear stiffness and tension (80 "
            "does well)"
        ),
    ] = None

    def build(self) -> "Formulation":
        """See `FormulationTable.build`."""
        from ..ply.formulations import Quadratic

        return Quadratic(self.deviation)


AnyFormulation: TypeAlias = OnePoint | Macro | Full | Quadratic

# ---------------------------------------------------------------------------- the rest


class Loads(Table):
    """Loads beside the conditions of the scene."""

    force_N: Annotated[
        dict[str, Annotated[tuple[float, ...], Meta(min_length=2, max_length=3)]],
        about(
            "whole force on a boundary along x and y, and z in space, in proportion to "
            "the load factor"
        ),
    ] = field(default_factory=dict)


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
]


class Stepping(Table):
    """Load steps and solvers."""

    steps: Annotated[int, about("load steps")] = 20
    tolerance: Annotated[
        float | None,
        about(
            "refine the mesh where the shear angle jumps until the estimated error of "
            "the load is below this share of it"
        ),
    ] = None
    most_unknowns: Annotated[
        int, about("no mesh of a run to a tolerance has more unknowns")
    ] = 50_000
    method: Annotated[
        Literal["newton", "plain"],
        about("plain: Newton's method with the consistent tangent, for small steps"),
    ] = "newton"
    warn_only: Annotated[
        tuple[Check, ...], about("checks that warn, and refuse no state")
    ] = ("work", "stabilisation", "deviation", "corners", "surface")
    solver: Annotated[
        Literal["auto", "cholmod", "pardiso", "superlu"],
        about(
            "linear solver: cholmod needs cvxopt, pardiso pypardiso; auto takes the "
            "fastest that is installed, which it measures for large systems"
        ),
    ] = "auto"


class Output(Table):
    """Files of a run beside its results."""

    pictures: Annotated[bool, about("draw pictures")] = True
    test_curve: Annotated[
        str | None,
        about("CSV file with the curve of a test, drawn beside the curve of the run"),
        FILE,
    ] = None
    part_mesh: Annotated[
        str | None,
        about("of a ply on a tool: mesh of the part, whose elements get fibres"),
        FILE,
    ] = None
    trim: Annotated[
        str | None,
        about(
            "of a ply on a tool: CSV file with the columns x, y and z of a closed "
            "curve that trims the flat pattern (default: the boundary of the part)"
        ),
        FILE,
    ] = None


class CaseFile(Table):
    """All tables of a case."""

    scene: AnyScene
    mesh: Mesh
    fabric: FabricOfFile
    tension: Tension
    shear: Shear
    bending: Bending
    formulation: AnyFormulation
    loads: Loads
    stepping: Stepping
    output: Output
    regions: dict[str, Region]
