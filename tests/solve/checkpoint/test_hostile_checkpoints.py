"""Damaged checkpoints are rejected in one line, or resumed to the same result."""

import io
import json
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import strategies as st
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import dot

from skfem_textile import (
    BodyForce,
    CheckpointError,
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
)
from skfem_textile.mesh.progress import unlogged
from skfem_textile.mesh.splitting import cut
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers.hostile import (
    RIGHT,
    Family,
    UnclearError,
    expect,
    expect_close,
    expect_equal,
    folder_content,
    rejected,
)
from tests.helpers.hostile.damage import REPLACEMENTS, TO_BYTES, replace_file

# Tolerance of results of two runs, relative to the largest of their kind.
TOLERANCE = 1e-9

CHECKS = ("work", "stabilisation", "deviation", "corners", "surface")

# Small runs


class Settings(NamedTuple):
    """Settings that determine the result of a run."""

    formulation: Any = OnePoint()
    shear: Any = Sin2(0.5)
    steps: int = 3
    size: tuple[int, int] = (3, 2)
    pull: float = 0.2
    weight: float = 0.0
    foundation: float = 0.0


# Interrupted runs; they have different history variables, or none.
BASES = (
    Settings(),
    Settings(OnePoint(1.0, "rate"), shear=0.5),
    Settings(Full(), steps=4, pull=0.1),
    Settings(Quadratic(), Sin2(1.0), steps=2, size=(2, 2), pull=0.1),
    Settings(steps=2, size=(2, 2), weight=1e-3, foundation=1e-2),
)

# Other settings with which a run is resumed.
OTHERS = (
    *({"formulation": OnePoint(1.0 + 1e-7)}, {"formulation": Full()}, {"steps": 5}),
    *({"shear": Sin2(0.51)}, {"shear": 0.5}, {"size": (4, 2)}, {"pull": 0.1 + 1e-7}),
    *({"weight": 2e-3}, {"weight": 0.0}, {"foundation": 0.02}, {"foundation": 0.0}),
)


def stepper(s, folder, **options):
    """The load stepper of a run, with its checkpoint in a folder or without one."""
    mesh = rectangle(3, 2, s.size, "irregular", 0.2, 1)
    mesh = cut(mesh) if isinstance(s.formulation, Quadratic) else mesh
    ply = Ply(mesh, Fabric(1e3, s.shear), s.formulation)
    if s.weight:
        ply = ply.with_terms(BodyForce((0.0, -s.weight)))
    if s.foundation:
        forms = Forms(
            Functional(lambda w: 0.5 * s.foundation * dot(w["u"], w["u"])),
            LinearForm(lambda v, w: s.foundation * dot(w["u"], v)),
            BilinearForm(lambda u, v, w: s.foundation * dot(u, v)),
        )
        ply = ply.with_terms(FormTerm("foundation", forms, ply.basis))
    conditions = {
        "clamp": Condition("bottom"),
        "pull": Condition("top", s.pull, (1, 0)),
        "level": Condition("top", 0.0, (0, 1)),
    }
    options |= {"warn_only": CHECKS, "solver": "superlu", "checkpoint": folder}
    return LoadStepper(ply, conditions, s.steps, **options)


@cache
@unlogged()
def undisturbed(settings):
    """The results of every state of a run that is not interrupted."""
    return results(stepper(settings, None).run().states)


@cache
@unlogged()
def checkpoint(settings, states, number=0):
    """Files of a run interrupted after some states; a new run for each number."""

    def interrupt(state):
        if len(run.states) == states:
            raise KeyboardInterrupt

    with TemporaryDirectory() as top:
        run = stepper(settings, Path(top, "c"), on_step=interrupt)
        with suppress(KeyboardInterrupt):
            run.run()
        return folder_content(Path(top, "c"))


def results(states):
    """Physical results of every state, without counts of the solution procedure."""
    strains = "max_fibre_strain", "mesh_fibre_strain"
    return [
        {
            "load factor": np.array(s.load_factor),
            "displacement": s.u,
            "energies": np.array(list(s.energies.values())),
            "reactions": np.array(list(s.reactions.values())),
            "means": np.array(list(s.displacements.values())),
            "det F": np.array(s.verdict.min_det_F),
            "strains": np.array([getattr(s.verdict, name) for name in strains]),
            "work": np.array(s.verdict.work),
        }
        for s in states
    ]


# Damage


class Checkpoint(NamedTuple):
    """A checkpoint, the settings with which it is resumed, and its damage.

    ``replaced`` is a file and its replacement.
    """

    damage: str
    settings: Settings
    files: dict[str, bytes]
    replaced: tuple[str, str] | None = None


KINDS = (
    *("changed", "changed", "emptied", "exchanged", "removed", "copied"),
    *("renamed", "doubled", "reordered", "added"),
)


@st.composite
def checkpoints(draw):
    settings = draw(st.sampled_from(BASES))
    states = draw(st.integers(1, settings.steps + 1))
    files = dict(checkpoint(settings, states))
    kind = draw(st.sampled_from(["forged"] * 7 + ["damaged"] * 10 + ["other run"] * 3))
    if kind == "forged":
        return Checkpoint(f"{states} states: {forge(draw, files)}", settings, files)
    if kind == "other run":
        other = draw(st.sampled_from(OTHERS))
        damage = f"{states} states, resumed with {other}"
        return Checkpoint(damage, settings._replace(**other), files)
    times = range(draw(st.integers(1, 2)))
    damages, replaced = [change_file(draw, files, settings) for _ in times], None
    if files and draw(st.integers(0, 9)) == 9:
        name = draw(st.sampled_from(sorted(files)))
        replaced = name, draw(st.sampled_from(REPLACEMENTS))
    return Checkpoint(f"{states} states: {damages}", settings, files, replaced)


def change_file(draw, files, settings):
    """Change a file of the checkpoint; returns a description."""
    if not files:
        return "nothing"
    name = draw(st.sampled_from(sorted(files)))
    kind = draw(st.sampled_from(KINDS))
    if kind == "changed":
        files[name] = draw(st.sampled_from(TO_BYTES))(draw, files[name])
    elif kind == "emptied":
        files[name] = b""
    elif kind == "exchanged":
        other = draw(st.sampled_from(sorted(files)))
        files[name], files[other] = files[other], files[name]
    elif kind == "removed":
        del files[name]
    elif kind == "copied":  # of another run, or of the same run repeated
        other = draw(st.sampled_from((settings, *BASES)))
        source = checkpoint(other, other.steps + 1, 1)
        files[name] = source.get(name, source["state_000000.npz"])
    elif kind in ("renamed", "doubled"):
        content = files.pop(name) if kind == "renamed" else files[name]
        files[another_name(draw)] = content
    elif kind == "reordered":
        states = sorted(n for n in files if n.startswith("state_"))
        contents = draw(st.permutations([files[n] for n in states]))
        files.update(zip(states, contents, strict=True))
    else:
        names = ".state_000009.npz", ".run.npz", "state_x.npz", "run.npz.old"
        files[draw(st.sampled_from(names))] = bytes(range(50))
    return f"{name} {kind}"


def another_name(draw):
    number = draw(st.integers(0, 6))
    usual = f"state_{number:06d}.npz"
    odd = f"state_{number}.npz", f"state_²{number}.npz", f"state_{10**18}.npz"
    return draw(st.sampled_from([usual] * 4 + [*odd, "run.npz"]))


# Forgery: files are edited with their checksums, independently of the library

VALUES = (
    *(0, -1, 1, 0.5, 1e308, 1e-300, float("nan"), float("inf"), 10**400),
    *(None, True, "auto", "", "two\nlines \x1b[31m", "long " * 2000, [], {}, [[]]),
    *(1 + 1e-7, [0.1, 0.2], {"a": 1}, -0.0),
)


def forge(draw, files):
    """Edit one or a few things of a file, and its checksum."""
    names = ["run.npz", *sorted(n for n in files if n.startswith("state_"))]
    number = draw(st.integers(0, len(names) - 1))
    with np.load(io.BytesIO(files[names[number]])) as content:
        arrays = dict(content)
    *head, _, text = json.loads(str(arrays.pop("text")))
    edits = [edit(draw, text, arrays) for _ in range(draw(st.integers(1, 3)))]
    body = io.BytesIO()
    content = json.dumps([*head, [*arrays], text])
    np.savez(body, text=np.array(content), **arrays)
    files[names[number]] = body.getvalue()
    return f"{names[number]}: {edits}"


def edit(draw, text, arrays):
    """Change, remove or add one thing in the text, or change an array."""
    if arrays and draw(st.integers(0, 9)) < 3:
        return edit_array(draw, arrays)
    *path, key = draw(st.sampled_from(key_paths(text)))
    inside = text
    for step in path:
        inside = inside[step]
    kind, old = draw(st.integers(0, 9)), inside[key]
    if kind == 0:
        del inside[key]
    elif kind == 1 and isinstance(inside, dict):
        inside[f"{key} more"] = old
    elif type(old) in (int, float) and kind < 6:
        factors = 1 + 1e-6, 1.01, -1.0, 2.0, 1e-3, 1e3
        factor = draw(st.sampled_from(factors))
        inside[key] = old * factor if isinstance(old, float) else old + 1
    else:
        inside[key] = draw(st.sampled_from(VALUES))
    return f"{path} {key}, {kind}"


def key_paths(value, path=()):
    """Paths of keys to everything in a JSON value."""
    paths = [path] if path else []
    if not isinstance(value, dict | list):
        return paths
    items = value.items() if isinstance(value, dict) else enumerate(value)
    return paths + [p for key, item in items for p in key_paths(item, (*path, key))]


def edit_array(draw, arrays):
    """Change one array, its shape or its kind."""
    name = draw(st.sampled_from(sorted(arrays)))
    size = arrays[name].size
    index, by = draw(st.integers(0, size)), draw(st.sampled_from((1.0, -1.0, 1e-4)))
    share = draw(st.sampled_from((1e-5, 1e-2, 1.0)))
    changes = {
        "moved": lambda x: x + share * (1 + np.abs(x).max()),
        "without an entry": lambda x: x.ravel()[:-1],
        "one axis more": lambda x: x[None],
        "complex": lambda x: x.astype(complex),
        "of single precision": lambda x: x.real.astype(np.float32),
        "of the other byte order": lambda x: x.astype(x.dtype.newbyteorder()),
        "text": lambda x: x.astype(str),
        "not a number": lambda x: x * np.nan,
        "empty": lambda x: x.ravel()[:0],
        "with one entry changed": lambda x: x + by * (np.arange(x.size) == index),
    }
    change = draw(st.sampled_from([*changes, "removed"]))
    if change == "removed" or arrays[name].dtype.kind not in "fiuc":
        del arrays[name]
        return f"{name} removed"
    arrays[name] = changes[change](arrays[name])
    return f"{name} {change}"


@unlogged()
def attempt(hostile):
    folder = Path("kept", "c").absolute()
    folder.mkdir(parents=True)
    for name, content in hostile.files.items():
        (folder / name).write_bytes(content)
    if hostile.replaced:
        name, kind = hostile.replaced
        replace_file(folder / name, kind)
    before = expected_remains(folder)
    try:
        run = stepper(hostile.settings, folder)
    except ValueError as error:  # no run can have these settings
        return rejected(error)
    try:
        result = run.run(resume=True)
    except CheckpointError as error:
        expect_equal("files after a refusal", expected_remains(folder), before)
        if str(folder) not in str(error):
            raise UnclearError(error) from None
        return rejected(str(error).replace(str(folder), "FOLDER"))
    computed, expected = results(result.states), undisturbed(hostile.settings)
    expect_equal("states", len(computed), len(expected))
    for name in expected[0]:
        scale = TOLERANCE * max(np.abs(state[name]).max() for state in expected)
        for value, right in (
            (a[name], b[name]) for a, b in zip(computed, expected, strict=True)
        ):
            expect(value.shape == right.shape, f"{name}: {value}, expected {right}")
            expect_close(name, value, right, scale)
    return RIGHT


def expected_remains(folder):
    """Files that a rejected run must leave: all except hidden ones of a killed run."""
    content = folder_content(folder)
    return {name: content[name] for name in content if not name.startswith(".")}


FAMILY = Family("checkpoints", {"": checkpoints()}, attempt, 2000, short=40)


@pytest.mark.slow
def test_a_damaged_checkpoint_is_rejected_or_resumed_to_the_same_result():
    FAMILY.check(30)
