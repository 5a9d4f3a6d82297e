"""Tension laws from biaxial tests.

Strains of a test are engineering strains, λ − 1; laws use ε = ln λ.  A fabric of width
W normal to the load has the force F = W T(ε)/λ.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy import ndarray

from ..fabric import BiaxialLaw, Law, TwoLaws
from . import models
from .models import Model
from .preparing import Preparation, prepare
from .reading import Format, read_recordings
from .regression import Fit, fit
from .solving import Sample

#: Fibre families.
FAMILIES = "warp", "weft"

#: Tension laws by name, as functions of the largest strain and the number of points.
TENSION_LAWS: dict[str, Callable[[float, int], Model]] = {
    "crimp-toe": lambda largest, points: models.crimp_toe(largest),
    "linear": lambda largest, points: models.linear(),
    "tabulated": models.tabulated,
    "crimp-interchange": lambda largest, points: models.crimp_interchange(largest),
}


@dataclass(frozen=True, eq=False)
class BiaxialCurve:
    """Test at one ratio of the strains.

    Attributes
    ----------
    name
        Name of the test.
    strain
        Logarithmic strains ln λ of warp and weft, shape (2, n).
    force
        Forces along warp and weft in N, shape (2, n).
    widths
        Width in mm normal to the warp load, and normal to the weft load.
    statements
        Description of the reading and preparation.
    """

    name: str
    strain: ndarray
    force: ndarray
    widths: tuple[float, float]
    statements: tuple[str, ...] = ()

    @property
    def tension(self) -> ndarray:
        """Tensions T = F λ/W in N/mm, shape (2, n)."""
        return self.force * np.exp(self.strain) / np.reshape(self.widths, (2, 1))

    def forces(self, law: BiaxialLaw) -> ndarray:
        """Forces predicted by a law of both strains, shape (2, n)."""
        widths, tension = np.reshape(self.widths, (2, 1)), law.value(self.strain)
        return widths * np.asarray(tension) / np.exp(self.strain)

    def force_along(self, family: int, law: Law) -> ndarray:
        """Force along a family predicted by a law of its strain, shape (n,)."""
        strain = self.strain[family]
        return self.widths[family] * law.value(strain) / np.exp(strain)


@dataclass(frozen=True, eq=False)
class TensionFit:
    """Tension laws from biaxial tests.

    Attributes
    ----------
    fits
        Fits by family, ``warp`` and ``weft``, or ``both`` for a law of both strains.
    curves
        The tests.
    """

    fits: dict[str, Fit]
    curves: tuple[BiaxialCurve, ...]

    @property
    def tension(self) -> BiaxialLaw | tuple[Law, Law]:
        """Laws, as an argument of `Fabric`."""
        if "both" in self.fits:
            return self.fits["both"].law
        return self.fits["warp"].law, self.fits["weft"].law

    def forces(self, curve: BiaxialCurve) -> ndarray:
        """Forces predicted by the laws, shape (2, n)."""
        law = self.tension
        return curve.forces(TwoLaws(*law) if isinstance(law, tuple) else law)

    def band(self, curve: BiaxialCurve) -> ndarray:
        """Confidence band of the predicted forces, lower and upper; shape (2, 2, n)."""
        if "both" in self.fits:
            both = self.fits["both"].band(partial(_both, curve))
            return both.reshape(2, *curve.force.shape)
        fits = (self.fits[name] for name in FAMILIES)
        bands = [one.band(partial(curve.force_along, i)) for i, one in enumerate(fits)]
        return np.stack(bands, axis=1)


def read_biaxial(
    path: str | os.PathLike[str],
    widths: tuple[float, float],
    form: Format | None = None,
    choices: Preparation | None = None,
) -> list[BiaxialCurve]:
    """Tests of a file or folder with strain and force of warp and weft.

    The family with the larger strain determines loading and unloading.  Strain and
    force have the zeros of the machine.

    Parameters
    ----------
    path
        The file or folder, see `read_recordings`.
    widths
        Width in mm normal to the warp load, and normal to the weft load.
    form
        Properties of the file that take precedence over its content.
    choices
        Choices of the preparation that take precedence, see `prepare`.

    Raises
    ------
    ValueError
        If the file is refused, a column is missing, or a strain is not above −1.
    OSError
        If it cannot be read.
    """
    strains, forces = ([f"{f} {of}" for f in FAMILIES] for of in ("strain", "force"))
    curves = []
    for recording in read_recordings(path, form):
        complete = recording.complete(*strains, *forces)
        driving = max(strains, key=lambda name: np.ptp(complete.column(name)))
        read = prepare(complete, driving, forces, choices).recording
        elongation, force = (
            np.array([read.column(name) for name in of]) for of in (strains, forces)
        )
        if not np.all(elongation > -1):
            raise ValueError(
                f"{read.name}: every strain must be above -1, got {elongation.min():g}"
            )
        curves.append(
            BiaxialCurve(
                *(read.name, np.log1p(elongation), force, widths, read.statements)
            )
        )
    return curves


def fit_tension(
    curves: Sequence[BiaxialCurve],
    law: str = "crimp-toe",
    *,
    points: int = 8,
    extrapolation: str | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> TensionFit:
    """Fit tension laws to biaxial tests at one or more ratios of the strains.

    Parameters
    ----------
    curves
        The tests.
    law
        A law of one strain for each family, ``crimp-toe``, ``linear`` or ``tabulated``;
        or ``crimp-interchange``, whose tensions depend on both strains.
    points
        Number of points of a table besides 0.
    extrapolation
        Extrapolation of a table, ``refuse`` or ``linear``, see `Tabulated`.
    bounds
        Smallest and largest value of parameters, by name.

    Raises
    ------
    ValueError
        If the law is unknown, or is not tabulated but has an extrapolation; if no fibre
        is stretched or loaded; or see `regression.fit`.
    """
    if law not in TENSION_LAWS:
        raise ValueError(
            f"unknown law {law!r}: choose one of {', '.join(TENSION_LAWS)}"
        )
    if law == "crimp-interchange":
        model = _model(law, curves, (0, 1), points, bounds, extrapolation)
        both = [Sample(c.name, c.force.ravel(), partial(_both, c)) for c in curves]
        return TensionFit({"both": fit(model, both, compare=False)}, tuple(curves))
    fits = {}
    for i, family in enumerate(FAMILIES):
        model = _model(law, curves, (i,), points, bounds, extrapolation)
        samples = [
            Sample(f"{c.name}, {family}", c.force[i], partial(c.force_along, i))
            for c in curves
        ]
        fits[family] = fit(model, samples)
    return TensionFit(fits, tuple(curves))


def _both(curve: BiaxialCurve, law: BiaxialLaw | Law) -> ndarray:
    """Both forces concatenated; a law of one strain applies to both families."""
    both = law if isinstance(law, BiaxialLaw) else TwoLaws(law, law)
    return curve.forces(both).ravel()


def _model(
    law: str,
    curves: Sequence[BiaxialCurve],
    families: tuple[int, ...],
    points: int,
    bounds: Mapping[str, tuple[float, float]] | None,
    extrapolation: str | None,
) -> Model:
    largest = max(float(c.strain[i].max()) for c in curves for i in families)
    if not largest > 0:
        raise ValueError(
            "no test contains a positive strain of the "
            f"{' or '.join(FAMILIES[i] for i in families)}"
        )
    for i in families:
        if not sum(float(c.force[i].sum()) for c in curves) > 0:
            raise ValueError(
                f"the forces along the {FAMILIES[i]} must be positive in tension: "
                "reverse the sign of the column"
            )
    model = TENSION_LAWS[law](largest, points).bounded(bounds or {})
    return model.extrapolated(extrapolation)
