"""Trials of damaged checkpoints: refused in one line, or resumed to the same end."""

import logging
from pathlib import Path

import numpy as np
from numpy.random import Generator

from skfem_textile import CheckpointError

from ..folders import folder_content, write_folder
from ..trial import RIGHT, SILENT, UNCLEAR, Family, Finding, refused
from .checkpoint_forgery import forged
from .file_damage import changed, emptied, exchanged, removed, replaced
from .small_runs import (
    BASES,
    Settings,
    checkpoint,
    difference,
    results,
    stepper,
    undisturbed,
)

#: Settings with which a run is resumed in place of its own.
OTHERS = (
    *({"cs": 2.0}, {"cs": 1.0 + 1e-7}, {"kind": "rate", "cs": 1.0}, {"kind": "jumps"}),
    *({"shear": 0.51}, {"shear_law": "linear"}, {"fibre": 1001.0}, {"steps": 5}),
    *({"seed": 2}, {"size": (4, 2)}, {"size": (2, 3)}, {"moved": 1e-6}),
    *({"moved": -1e-3}, {"pull": 0.15}, {"pull": 0.1 + 1e-7}, {"clamp": "left"}),
    *({"warp": 1e-4}, {"warp": 45.0}, {"formulation": "full"}, {"max_halvings": 7}),
    *({"formulation": "quadratic"}, {"method": "plain"}, {"warn_only": ()}),
    *({"weight": 2e-3}, {"weight": 0.0}, {"foundation": 0.02}, {"foundation": 0.0}),
    *({"solver": "cholmod"}, {"solver": "pardiso"}, {"moved": 1e-14}),
)


def attempt(seed: int, folder: Path) -> Finding:
    """Damage a checkpoint and resume it."""
    logging.disable()
    rng = np.random.default_rng(seed)
    settings = BASES[rng.integers(len(BASES))]
    number = int(rng.integers(1, settings.steps + 2))
    place = write_folder(checkpoint(settings, number), folder / "c")
    if (kind := rng.random()) < 0.35:
        damage = forged(rng, place)
    elif kind < 0.85:
        damages = [_damaged(rng, place, settings) for _ in range(rng.choice([1, 1, 2]))]
        damage = ", ".join(damages)
    else:
        other = OTHERS[rng.integers(len(OTHERS))]
        settings = settings._replace(**other)
        damage = f"resumed with {other}"
    damage = f"{number} state(s) of {settings.formulation} {settings.kind}: {damage}"
    return _finding(damage, settings, place)


def _kept(place: Path) -> dict[str, bytes]:
    """What a refused run must leave; hidden files are remains of a killed run."""
    content = folder_content(place)
    return {name: content[name] for name in content if not name.startswith(".")}


def _finding(damage: str, settings: Settings, place: Path) -> Finding:
    before = _kept(place)
    try:
        run = stepper(settings, place)
    except ValueError as error:  # no run can have these settings
        return refused(damage, str(error))
    try:
        result = run.run(resume=True)
    except CheckpointError as error:
        if _kept(place) != before:
            return Finding(SILENT, damage, f"the folder has changed after: {error}")
        if str(place) not in str(error):
            return Finding(UNCLEAR, damage, str(error))
        return refused(damage, str(error).replace(str(place), "FOLDER"))
    if wrong := difference(results(result.states), undisturbed(settings)):
        return Finding(SILENT, damage, wrong)
    return Finding(RIGHT, damage)


def _damaged(rng: Generator, place: Path, settings: Settings) -> str:
    """Do something to a file of the checkpoint."""
    files = sorted(p for p in place.iterdir() if p.is_file() and not p.is_symlink())
    if not files:
        return "nothing"
    path = files[rng.integers(len(files))]
    damages = (
        *(changed, changed, emptied, exchanged, removed, replaced),
        *(_copied, _renamed, _doubled, _reordered, _added),
    )
    damage = damages[rng.integers(len(damages))]
    if damage is _copied:
        return _copied(rng, path, settings)
    return damage(rng, path)


def _copied(rng: Generator, path: Path, settings: Settings) -> str:
    """A file replaced by a file of another run, or of the same run made again."""
    again = rng.random() < 0.5
    others = [base for base in BASES if base != settings]
    other = settings if again else others[rng.integers(len(others))]
    source = checkpoint(other, other.steps + 1, 1)
    name = path.name if path.name in source else "state_000000.npz"
    path.write_bytes(source[name])
    return f"{path.name} of {'the same run made again' if again else 'another run'}"


def _renamed(rng: Generator, path: Path) -> str:
    """A file under another number."""
    other = path.rename(path.with_name(_name(rng)))
    return f"{path.name} renamed {other.name}"


def _doubled(rng: Generator, path: Path) -> str:
    """A copy of a file under another number."""
    other = path.with_name(_name(rng))
    other.write_bytes(path.read_bytes())
    return f"{path.name} copied to {other.name}"


def _reordered(rng: Generator, path: Path) -> str:
    """All states in another order."""
    states = sorted(p for p in path.parent.glob("state_*.npz") if p.is_file())
    contents = [p.read_bytes() for p in states]
    order = rng.permutation(len(states))
    for state, i in zip(states, order, strict=True):
        state.write_bytes(contents[i])
    return f"states in the order {order.tolist()}"


def _added(rng: Generator, path: Path) -> str:
    """Something beside the files."""
    names = ("notes.txt", ".state_000009.npz", ".run.npz", "state_x.npz", "run.npz.old")
    name = str(rng.choice(names))
    path.with_name(name).write_bytes(rng.bytes(50))
    return f"{name} added"


def _name(rng: Generator) -> str:
    number = int(rng.integers(7))
    names = (f"state_{number:06d}.npz", f"state_{number}.npz", f"state_²{number}.npz")
    return str(rng.choice([*[names[0]] * 4, *names, f"state_{10**18}.npz", "run.npz"]))


FAMILY = Family("checkpoints", attempt, trials=2000, short=40)
