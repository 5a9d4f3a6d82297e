"""Small runs, from which checkpoints are made."""

from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from skfem import BilinearForm, Functional, LinearForm, Mesh
from skfem.helpers import dot

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Forms,
    FormTerm,
    Full,
    LoadStepper,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
    State,
)
from skfem_textile.mesh.splitting import cut
from skfem_textile.scenes.rectangle import rectangle

from ..folders import folder_content

#: By how much results of two runs may differ, as a share of the largest of their kind.
_TOLERANCE = 1e-9


class Settings(NamedTuple):
    """Everything that decides the result of a run."""

    formulation: str = "one-point"
    cs: float | str = "auto"
    kind: str = "energy"
    shear: float = 0.5
    shear_law: str = "sin2"
    fibre: float = 1e3
    steps: int = 3
    seed: int = 1
    size: tuple[int, int] = (3, 2)
    moved: float = 0.0
    pull: float = 0.2
    clamp: str = "bottom"
    warp: float = 0.0
    method: str = "newton"
    max_halvings: int = 8
    warn_only: tuple[str, ...] = (
        "work",
        "stabilisation",
        "deviation",
        "corners",
        "surface",
    )
    solver: str = "superlu"
    weight: float = 0.0
    foundation: float = 0.0


#: The runs that are interrupted; they keep different data from step to step, or none.
BASES = (
    Settings(),
    Settings(cs=1.0, kind="rate", shear_law="linear"),
    Settings("full", steps=4, pull=0.1),
    Settings("quadratic", steps=2, size=(2, 2), pull=0.1, shear=1.0),
    Settings(steps=2, size=(2, 2), weight=1e-3, foundation=1e-2),
)


def stepper(settings: Settings, folder: Path | None, **options: Any) -> LoadStepper:
    """The load stepper of a run, with its checkpoint in a folder or without one."""
    s = settings
    shear = Sin2(s.shear) if s.shear_law == "sin2" else s.shear
    fabric = Fabric(s.fibre, shear, *_fibres(s.warp))
    conditions = {
        "clamp": Condition(s.clamp),
        "pull": Condition("top", s.pull, (1, 0)),
        "level": Condition("top", 0.0, (0, 1)),
    }
    formulation = {
        "one-point": lambda: OnePoint(s.cs, s.kind),  # type: ignore[arg-type]
        "full": Full,
        "quadratic": Quadratic,
    }[s.formulation]()
    return LoadStepper(
        _with_further_terms(Ply(_mesh(s), fabric, formulation), s),
        conditions,
        s.steps,
        method=s.method,
        max_halvings=s.max_halvings,
        warn_only=s.warn_only,
        solver=s.solver,
        checkpoint=folder,
        **options,
    )


def _with_further_terms(ply: Ply, settings: Settings) -> Ply:
    s = settings
    if s.weight:
        ply = ply.with_terms(BodyForce((0.0, -s.weight)))
    if s.foundation:
        forms = Forms(
            Functional(lambda w: 0.5 * s.foundation * dot(w["u"], w["u"])),
            LinearForm(lambda v, w: s.foundation * dot(w["u"], v)),
            BilinearForm(lambda u, v, w: s.foundation * dot(u, v)),
        )
        ply = ply.with_terms(FormTerm("foundation", forms, ply.basis))
    return ply


def _mesh(settings: Settings) -> Mesh:
    s = settings
    mesh = rectangle(3, 2, s.size, "irregular", 0.2, s.seed)
    p = mesh.p.copy()
    p[0, len(p[0]) // 2] += s.moved
    mesh = type(mesh)(p, mesh.t).with_defaults()
    return cut(mesh) if s.formulation == "quadratic" else mesh


def _fibres(warp: float) -> list[np.ndarray]:
    angles = np.radians([warp, 90.0 + warp])
    return [np.array([np.cos(angle), np.sin(angle)]) for angle in angles]


@cache
def undisturbed(settings: Settings) -> list[dict[str, np.ndarray]]:
    """The results of every state of a run that is not interrupted."""
    return results(stepper(settings, None).run().states)


@cache
def checkpoint(settings: Settings, states: int, number: int = 0) -> dict[str, bytes]:
    """Files of a run interrupted after some states; a new run for each number."""

    def interrupt(state: State) -> None:
        if len(run.states) == states:
            raise KeyboardInterrupt

    with TemporaryDirectory() as top:
        run = stepper(settings, Path(top, "c"), on_step=interrupt)
        with suppress(KeyboardInterrupt):
            run.run()
        return folder_content(Path(top, "c"))


def results(states: list[State]) -> list[dict[str, np.ndarray]]:
    """Physical results of every state, without counts of the solution procedure."""
    return [
        {
            "load factor": np.array(s.load_factor),
            "displacement": s.u,
            "energies": np.array(list(s.energies.values())),
            "reactions": _all_components(s.reactions),
            "means": _all_components(s.displacements),
            "det F": np.array(s.verdict.min_det_F),
            "strains": np.array(
                [s.verdict.max_fibre_strain, s.verdict.mesh_fibre_strain]
            ),
            "work": np.array(s.verdict.work),
        }
        for s in states
    ]


def _all_components(vectors: dict[str, np.ndarray]) -> np.ndarray:
    """The components of all vectors; a forged checkpoint may give them any shape."""
    return np.concatenate([np.ravel(v) for v in vectors.values()])


def difference(
    resumed: list[dict[str, np.ndarray]], undisturbed: list[dict[str, np.ndarray]]
) -> str:
    """What differs first between two runs; empty where nothing does."""
    if len(resumed) != len(undisturbed):
        return f"{len(resumed)} states, not {len(undisturbed)}"
    for name in undisturbed[0]:
        largest = max(np.abs(state[name]).max() for state in undisturbed)
        pairs = zip(resumed, undisturbed, strict=True)
        for i, (value, right) in enumerate((a[name], b[name]) for a, b in pairs):
            if value.shape != right.shape:
                return f"{name} of state {i} in its shape"
            if not np.all(np.abs(value - right) <= _TOLERANCE * largest):
                off = np.abs(value - right).max()
                return f"{name} of state {i} by {off:.3g}, of {largest:.3g}"
    return ""
