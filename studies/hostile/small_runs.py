"""Runs of a tiny ply, by their settings: what checkpoints are made of."""

import os
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
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.splitting import cut

#: How far figures of one run may be apart, as a share of the largest of their kind.
SAME = 1e-9

#: Files of a folder by name.
Files = dict[str, bytes]


class Settings(NamedTuple):
    """What a run is made of; equal settings give equal results."""

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
    strategies: tuple[str, ...] = ("mixed", "descent")
    max_halvings: int = 8
    warn_only: tuple[str, ...] = ("work", "stabilisation", "corners")
    solver: str = "superlu"
    weight: float = 0.0
    foundation: float = 0.0


#: The runs that are interrupted: their plies remember different things, or nothing.
BASES = (
    Settings(),
    Settings(cs=1.0, kind="rate", shear_law="linear"),
    Settings("full", steps=4, pull=0.1),
    Settings("quadratic", steps=2, size=(2, 2), pull=0.1, shear=1.0),
    Settings(steps=2, size=(2, 2), weight=1e-3, foundation=1e-2),
)


def stepper(settings: Settings, folder: Path | None, **options: Any) -> LoadStepper:
    """The load stepper of a run, with its checkpoint in a folder."""
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
        strategies=s.strategies,
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
    """The figures of every state of a run that nobody disturbs."""
    return figures(stepper(settings, None).run().states)


@cache
def checkpoint(settings: Settings, states: int, number: int = 0) -> Files:
    """The files of a run interrupted after so many states, made for the n-th time."""

    def interrupt(state: State) -> None:
        if len(run.states) == states:
            raise KeyboardInterrupt

    with TemporaryDirectory() as top:
        run = stepper(settings, Path(top, "c"), on_step=interrupt)
        with suppress(KeyboardInterrupt):
            run.run()
        return files(Path(top, "c"))


def figures(states: list[State]) -> list[dict[str, np.ndarray]]:
    """What is physical of every state; how it was found is not."""
    return [
        {
            "load factor": np.array(s.load_factor),
            "displacement": s.u,
            "energies": np.array(list(s.energies.values())),
            "reactions": _together(s.reactions),
            "means": _together(s.displacements),
            "det F": np.array(s.verdict.min_det_F),
            "strains": np.array(
                [s.verdict.max_fibre_strain, s.verdict.mesh_fibre_strain]
            ),
            "work": np.array(s.verdict.work),
        }
        for s in states
    ]


def _together(vectors: dict[str, np.ndarray]) -> np.ndarray:
    """All components, whatever shapes a forger has given them."""
    return np.concatenate([np.ravel(v) for v in vectors.values()])


def differing(
    found: list[dict[str, np.ndarray]], right: list[dict[str, np.ndarray]]
) -> str:
    """What differs between two runs; empty where nothing does."""
    if len(found) != len(right):
        return f"{len(found)} states, not {len(right)}"
    for name in right[0]:
        most = max(np.abs(one[name]).max() for one in right)
        for i, (ours, theirs) in enumerate(zip(found, right, strict=True)):
            if ours[name].shape != theirs[name].shape:
                return f"{name} of state {i} in its shape"
            if not np.all(np.abs(ours[name] - theirs[name]) <= SAME * most):
                off = np.abs(ours[name] - theirs[name]).max()
                return f"{name} of state {i} by {off:.3g}, of {most:.3g}"
    return ""


def files(folder: Path) -> Files:
    """Every file of a folder; what is no file as what it is."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = f"link to {os.readlink(path)}".encode()
        elif path.is_file():
            found[name] = path.read_bytes()
        else:
            found[name] = f"mode {path.lstat().st_mode}".encode()
    return found


def written(content: Files, folder: Path) -> Path:
    """Write files into a new folder."""
    folder.mkdir()
    for name, some in content.items():
        (folder / name).write_bytes(some)
    return folder
