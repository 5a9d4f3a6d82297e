"""Fits of the fabrics of the catalogue to published measurements."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

from skfem_textile import Fabric
from skfem_textile.calibration import (
    BiasExtension,
    Choice,
    FabricFit,
    Simulation,
    Specimen,
    Strip,
    fit_tests,
)
from skfem_textile.calibration.choice import Test
from skfem_textile.fabric.files import fabric_text
from skfem_textile.fabric.origin import Origin

from ..measured.published import (
    ASSUMED,
    BIAS,
    FABRICS,
    columns,
    fibre_stiffnesses,
    of_fabric,
    properties,
)

# Significant digits of a fabric file: beyond rounding errors of the fit, and far finer
# than the scatter.
_DIGITS = 5

_CAO = (
    "J. Cao, R. Akkerman, P. Boisse et al., Characterization of mechanical behavior of "
    "woven fabrics: experimental methods and benchmark results, Composites Part A 39 "
    "(2008) 1037-1053, doi 10.1016/j.compositesa.2008.02.016"
)
_FARRELL = (
    "D. T. Farrell, C. M. McCann, A. E. Forte, C. J. Walsh, K. Bertoldi, Programmable "
    "surface dimpling of textile metamaterials for aerodynamic control; data in "
    "github.com/bertoldi-collab/aerodynamic-textile-metamaterials (MIT), commit 8bec4db"
)

# Quantities that neither publication measured.
_ASSUMED = {
    "directions": "warp and weft at right angles at rest",
    "wrinkling_angle": "no locking angle was measured: 90 degrees, no limit",
}
_UNTIL_40 = (
    "Shear angles follow from the displacement of the clamps without slip of yarns, up "
    "to 40 degrees; beyond them the law is extrapolated by its polynomial.",
    "Below 10 degrees most specimens resist more than the polynomial.",
    "Picture frames of the same article give other laws.",
)


@dataclass(frozen=True)
class Entry:
    """Fabric of the catalogue.

    Attributes
    ----------
    name
        Name in the catalogue.
    title
        Name of the fabric.
    """

    name: str
    title: str

    def tests(self) -> list[Test]:
        """The measurements."""
        raise NotImplementedError

    def fit(self) -> FabricFit:
        """Fit of the laws."""
        raise NotImplementedError

    def base(self) -> Fabric:
        """Fabric with the laws that were not measured."""
        raise NotImplementedError

    def origin(self, fit: FabricFit) -> Origin:
        """Sources, assumptions and specimens."""
        raise NotImplementedError

    def text(self, fit: FabricFit) -> str:
        """Content of the file of the fabric."""
        text = fabric_text(fit.fabric(self.base()), self.origin(fit))
        rounded = json.loads(text, parse_float=_rounded)
        return json.dumps(rounded, indent=1) + "\n"


def _rounded(number: str) -> float:
    return float(f"{float(number):.{_DIGITS}g}")


@dataclass(frozen=True)
class Cao(Entry):
    """Fabric of Cao et al. 2008: shear law from bias extensions.

    Attributes
    ----------
    fabric
        Name in the published measurements.
    """

    fabric: str

    def tests(self) -> list[Test]:
        """The bias extensions."""
        return [curve.specimen for curve in of_fabric(self.fabric, BIAS)]

    def fit(self) -> FabricFit:
        """A polynomial of degree 5, of inextensible fibres."""
        return fit_tests(self.tests(), Choice("polynomial"))

    def base(self) -> Fabric:
        """The assumed fibre stiffness."""
        return Fabric(fibre_stiffnesses(self.fabric))

    def origin(self, fit: FabricFit) -> Origin:
        """Sources, assumptions and specimens."""
        found = fit.origin()
        number = len(found.specimens["shear"])
        shear = (
            f"polynomial of degree 5, fitted to the forces of {number} bias extensions "
            f"(width x height in mm, laboratory) of Fig. {FABRICS[self.fabric][1]}"
        )
        warp, weft = fibre_stiffnesses(self.fabric)
        tension = (
            f"no tension test was published: {warp:.0f} N/mm in warp and {weft:.0f} "
            f"N/mm in weft, {ASSUMED}"
        )
        return replace(
            found,
            title=self.title,
            reference=_CAO,
            sources={"shear": shear},
            assumed={
                "tension": tension,
                "bending": "no bending test was published: no bending stiffness",
                **_ASSUMED,
            },
            properties={
                name: f"{text} (Table 1)"
                for name, text in properties(self.fabric).items()
            },
            notes=_UNTIL_40,
        )


@dataclass(frozen=True)
class Nylon(Entry):
    """Woven nylon: linear laws from strips along, across and at 45° to the fibres."""

    # Number of parallel strips of a test, and width and length of each in mm.
    strips: int = 12
    width: float = 2.25
    length: float = 97.0

    def tests(self) -> list[Test]:
        """Strips at 0°, 90° and 45°."""
        data = columns("nylon/forces.csv")
        moved = data["displacement_mm"]
        force = {angle: data[f"measured_{angle}"] for angle in (0, 45, 90)}
        size = self.strips * self.width, self.length
        bias = BiasExtension(self.width, self.length)
        of_one = force[45] / self.strips
        return [
            Strip("0 degrees", "warp", *size, displacement=moved, force=force[0]),
            Strip("90 degrees", "weft", *size, displacement=moved, force=force[90]),
            Specimen("45 degrees", bias, of_one, displacement=moved),
        ]

    def fit(self) -> FabricFit:
        """Linear laws; the strip at 45° is simulated with extensible fibres."""
        choice = Choice("linear", "linear")
        return fit_tests(self.tests(), choice, Simulation(across=4, steps=6))

    def base(self) -> Fabric:
        """No law remains to be assumed."""
        return Fabric()

    def origin(self, fit: FabricFit) -> Origin:
        """Sources, assumptions and specimens."""
        test = f"{self.strips} parallel strips of {self.width:g} mm, one test"
        return replace(
            fit.origin(),
            title=self.title,
            reference=_FARRELL,
            sources={
                "tension": f"linear laws, fitted to strips at 0 and 90 degrees to the "
                f"warp (x) up to 4 % strain; {test} each",
                "shear": f"linear law, fitted by simulation to strips at 45 degrees; "
                f"{test}",
            },
            assumed={
                "bending": "one of the two published cantilever tips is impossible for "
                "an inextensible strip: no bending stiffness",
                **_ASSUMED,
            },
            notes=(
                "One test in each direction: the scatter between specimens is unknown.",
                "The fabric is coated: its laws do not apply to a dry fabric.",
                "Compression was not measured: the laws are linear there too.",
            ),
        )


#: The fabrics.
ENTRIES: Sequence[Entry] = (
    Cao("cao2008-plain-weave", "glass/PP plain weave TPEET22XXX", "plain"),
    Cao(
        "cao2008-balanced-twill",
        "glass/PP balanced 2/2 twill TPEET44XXX",
        "balanced twill",
    ),
    Cao(
        "cao2008-unbalanced-twill",
        "glass/PP unbalanced 2/2 twill TPECU53XXX",
        "unbalanced twill",
    ),
    Nylon("farrell-woven-nylon", "heat-bondable (coated) woven nylon"),
)
