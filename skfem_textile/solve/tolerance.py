"""Runs on finer and finer meshes, until the error interval is inside a tolerance."""

import logging
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from functools import partial
from numbers import Real
from typing import Any

import numpy as np

from ..mesh.user_input import error_text, shortened
from .interval import ErrorInterval
from .quantities import Quantity
from .result import Driven, Result, StepError
from .states import State
from .stepper import LoadStepper

log = logging.getLogger(__name__)

# Exponent of the half-width as a function of the density, on nets along the singular
# fibres: 1.9 between the densities 1 and 4.  The next density is chosen with it.
_ORDER = 1.9

# Next density over the present one: at least, at most, and where there is no interval.
_LEAST_STEP, _MOST_STEP, _WITHOUT_INTERVAL = 1.2, 4.0, 2.0

# Margin of the next density, because half-widths do not follow a power exactly.
_MARGIN = 1.15

# Maximum number of meshes that are generated to find the largest one allowed: the
# number of unknowns is not an exact power of the density.
_TRIED = 3

# Largest share of stabilisation or deviations in energy and work, above which a
# tolerance is not met.
_MOST_NUMERICAL = 0.1


@dataclass(frozen=True)
class Round:
    """One mesh of a run to a tolerance.

    Attributes
    ----------
    density
        Density of the mesh, the argument of ``stepper_at``.
    unknowns, linear_solves
        Number of unknowns, and of linear solves for the whole load path.
    half_width
        Half-width of the error interval relative to the load; None if there is none.
    """

    density: float
    unknowns: int
    linear_solves: int
    half_width: float | None

    def __str__(self) -> str:
        half = "none" if self.half_width is None else f"± {self.half_width:.2%}"
        return (
            f"density {self.density:.3g}: {self.unknowns} unknowns, "
            f"{self.linear_solves} linear solves, error of the load: {half}"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ToleranceResult(Result):
    """Result on the last mesh, with all meshes that were solved.

    Attributes
    ----------
    tolerance
        Relative tolerance of the load.
    rounds
        All rounds, including the one on the last mesh.
    """

    tolerance: float
    rounds: tuple[Round, ...]

    @property
    def tolerance_met(self) -> bool:
        """True if the whole load was applied and the interval is inside the tolerance.

        Stabilisation and deviations may each carry at most a tenth of energy and work.
        """
        half, shares = self.error.load, self.states[-1].shares
        numerical = [x for of in ("energy", "work") for x in shares[of].values()]
        carried = max(numerical, default=0.0) <= _MOST_NUMERICAL
        return (
            self.converged and half is not None and half <= self.tolerance and carried
        )

    def summary(self, driven: Driven | None = None) -> dict[str, Any]:
        """As in `Result`, with ``tolerance``, ``tolerance_met`` and ``rounds``."""
        summary = super().summary(driven)
        met = "met" if self.tolerance_met else "not met"
        note = f" of the load: {met} on mesh {len(self.rounds)}"
        tolerance = Quantity("Tolerance", "tolerance", "%", note=note)
        summary["first"].append(tolerance.declared())
        return summary | {
            "tolerance": self.tolerance,
            "tolerance_met": self.tolerance_met,
            "rounds": [asdict(one) for one in self.rounds],
        }


class ToleranceStepper:
    """Load stepper on finer and finer meshes, up to a tolerance of the load.

    The whole load is applied on each mesh.  The density of the next one follows from
    the half-width of the error interval, which decreases almost with the square of the
    density on nets along the singular fibres (`mesh_outline`).

    Parameters
    ----------
    stepper_at
        Function that returns the `LoadStepper` on a mesh of a given density.
    tolerance
        Tolerance of the load, relative to it, between 0 and 1.
    density
        Density of the first mesh.
    most_unknowns
        Largest number of unknowns of a mesh; by default as in a case file.
    on_round
        Called with each `Round`.

    Raises
    ------
    ValueError
        If an argument is not valid, or the first mesh has too many unknowns; see also
        `LoadStepper`.

    Examples
    --------
    >>> from skfem_textile import Fabric, LoadStepper, Ply, Quadratic, ToleranceStepper
    >>> from skfem_textile.scenes import bias_extension
    >>> fabric, scene = Fabric(1e5, 0.5), bias_extension(size=(1, 1))
    >>> def at(density):
    ...     graded = scene.graded(fabric, density)
    ...     directed = Fabric(1e5, 0.5, scene.warp, scene.weft)
    ...     ply = Ply(graded.mesh, directed, Quadratic(400, points=6))
    ...     return LoadStepper(ply, graded.conditions, steps=1)
    >>> result = ToleranceStepper(at, 0.01).run()
    >>> result.tolerance_met
    True
    """

    checkpoint = None

    def __init__(
        self,
        stepper_at: Callable[[float], LoadStepper],
        tolerance: float,
        density: float = 1.0,
        *,
        most_unknowns: int = 50_000,
        on_round: Callable[[Round], None] | None = None,
    ) -> None:
        settings = {
            "tolerance": tolerance,
            "density": density,
            "most_unknowns": most_unknowns,
        }
        for name, value in settings.items():
            if not (isinstance(value, Real) and 0 < float(value) < np.inf):
                raise ValueError(
                    f"{name} must be a number above 0, got {shortened(value)}"
                )
        if not tolerance < 1:
            raise ValueError(
                f"the tolerance must be between 0 and 1, got {shortened(tolerance)}"
            )
        self._at, self.tolerance, self._density = stepper_at, tolerance, density
        self.most_unknowns, self.on_round = most_unknowns, on_round
        self._first = self._stepper = stepper_at(density)
        if self._stepper.problem.has_friction:
            raise ValueError(
                "a tolerance requires laws and tools without friction, for which the "
                "error of the load is known: omit it and compare with a finer mesh"
            )
        if most_unknowns < self._stepper.ply.basis.N:
            raise ValueError(
                f"the ply has {self._stepper.ply.basis.N} unknowns, more than "
                f"most_unknowns, {most_unknowns}"
            )
        self._rounds: list[Round] = []
        self._interval: Callable[[State], ErrorInterval] | None = None

    def run(self, resume: bool = False) -> ToleranceResult:
        """Apply the load on finer and finer meshes until the tolerance is met.

        Parameters
        ----------
        resume
            Not supported: there is no checkpoint.

        Raises
        ------
        StepError
            If the load cannot be applied, nothing carries a load, the meshes stop
            growing with the density, or the tolerance is not met within
            ``most_unknowns``.  Its ``result`` is the result on the last
            mesh on which the whole load was applied, if there is one.
        """
        if resume:
            raise ValueError(
                "a run to a tolerance writes no checkpoint and cannot be resumed"
            )
        self._rounds, self._interval = [], None
        try:
            self._run_all()
        except StepError:
            raise
        except Exception as error:  # a user's function may raise anything
            if not self._rounds:
                raise
            last = self._rounds[-1].density
            why = f"after the mesh of density {last:.3g}: {error_text(error)}"
            raise self._error(why) from error
        result = self.result
        if result.tolerance_met:
            return result
        half, reason = result.error.load, result.error.reason
        found = f"has no interval ({reason})" if half is None else f"is ± {half:.2%}"
        raise self._error(
            f"the tolerance is not met with at most {self.most_unknowns} unknowns: the "
            f"error of the load {found}, but ± {100 * self.tolerance:g} % was "
            "requested; increase most_unknowns or the tolerance"
        )

    def _run_all(self) -> None:
        """Runs on finer and finer meshes, as far as `most_unknowns` allows."""
        density, stepper, fits = self._density, self._first, True
        while True:
            self._run(stepper, density)
            result = self.result
            if result.tolerance_met or not fits:
                return
            if result.error.load is None and result.error.shear_angle is not None:
                raise self._error(
                    "the tolerance is relative to the load, whose error is not known: "
                    f"{result.error.reason}"
                )
            solved = density
            density, stepper = self._finer(density, density * self._next(result))
            fits = self.most_unknowns >= stepper.ply.basis.N
            if not fits:
                largest = self._largest(solved, density, stepper)
                if largest is None:
                    return
                density, stepper = largest

    def _largest(
        self, solved: float, density: float, stepper: LoadStepper
    ) -> tuple[float, LoadStepper] | None:
        """Density and stepper of the largest mesh allowed, if it is finer.

        The number of unknowns is interpolated between the solved mesh and one that is
        too large, as a power of the density.
        """
        unknowns, most = self._stepper.ply.basis.N, self.most_unknowns
        for _ in range(_TRIED):
            too_many = stepper.ply.basis.N
            share = np.log(most / unknowns) / np.log(too_many / unknowns)
            tried = solved * float((density / solved) ** share)
            at = self._at(tried)
            if unknowns < at.ply.basis.N <= most:
                return tried, at
            if not most < at.ply.basis.N < too_many:
                return None
            density, stepper = tried, at
        return None

    def _finer(self, solved: float, density: float) -> tuple[float, LoadStepper]:
        """Density and stepper of a mesh with more unknowns than the solved one."""
        unknowns, stepper = self._stepper.ply.basis.N, self._at(density)
        while unknowns >= stepper.ply.basis.N:
            if density >= _MOST_STEP * solved:
                raise self._error(
                    f"stepper_at returns no mesh with more than {unknowns} unknowns: "
                    f"{stepper.ply.basis.N} at density {density:.3g}; the mesh must "
                    "become finer as the density increases"
                )
            density *= _WITHOUT_INTERVAL
            stepper = self._at(density)
        return density, stepper

    @property
    def states(self) -> tuple[State, ...]:
        """States on the last mesh on which the whole load was applied.

        Before there is such a mesh, the states so far.
        """
        return self._stepper.states

    @property
    def result(self) -> ToleranceResult:
        """Result so far."""
        result = self._stepper.result
        values = {field.name: getattr(result, field.name) for field in fields(Result)}
        if self._interval is not None:
            values["interval"] = self._interval
        return ToleranceResult(
            **values, tolerance=self.tolerance, rounds=tuple(self._rounds)
        )

    def _run(self, stepper: LoadStepper, density: float) -> None:
        """Apply the whole load on a mesh; on failure the last mesh is kept."""
        try:
            result = stepper.run()
        except StepError as error:
            if self._rounds:
                unknowns = stepper.ply.basis.N
                raise self._error(
                    f"on a finer mesh with {unknowns} unknowns: {error}"
                ) from None
            self._stepper = stepper
            raise StepError(
                str(error), self.result, error.elements, error.quantity
            ) from None
        self._stepper, found = stepper, result.error
        self._interval = partial(_interval_of, result)
        unknowns, solves = int(result.ply.basis.N), result.linear_solves
        one = Round(density, unknowns, solves, found.load)
        self._rounds.append(one)
        log.info("%s", one)
        if self.on_round is not None:
            self.on_round(one)

    def _next(self, result: Result) -> float:
        """Next density relative to the present one."""
        half = result.error.load
        if half is None:
            return _WITHOUT_INTERVAL
        step = _MARGIN * (half / self.tolerance) ** (1 / _ORDER)
        return float(np.clip(step, _LEAST_STEP, _MOST_STEP))

    def _error(self, why: str) -> StepError:
        return StepError(why, self.result, np.empty(0, dtype=int))


def _interval_of(result: Result, state: State) -> ErrorInterval:
    """Interval of a state; it is known for the last one."""
    last = state is result.states[-1]
    return result.error if last else result.interval(state)
