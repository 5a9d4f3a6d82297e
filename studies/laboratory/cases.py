"""Raw files made from known laws, read, prepared and fitted."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy import ndarray

from skfem_textile import Law
from skfem_textile.calibration import (
    BiasExtension,
    Choice,
    PictureFrame,
    ShearTest,
    fit_tests,
    read_recordings,
    read_specimens,
)
from skfem_textile.calibration.choice import SHEAR_LAWS

from ..study import Row
from .joint import JointCase, joint_cases
from .machines import MACHINES, Curve, Export
from .repeats import Repeats, repeats_cases

#: Laws and their parameters at the scale 1: softening and stiffening, convex, straight.
LAWS: dict[str, tuple[tuple[float, ...], ...]] = {
    "polynomial": ((0.3, -0.3, 0.6), (0.1, 0.05, 0.4)),
    "sin2": ((0.1,),),
    "linear": ((0.1,),),
}

#: Contaminations, each with this probability in a contaminated file.
CONTAMINATIONS = "toe", "hysteresis", "outliers"
_SHARE = 0.5

#: Groups of files.  Those with a force at rest also have a toe, so that a zero of each
#: kind is unknown.
GROUPS = "clean", "contaminated", "force at rest"

#: Ranges of their sizes: toe in mm, loss of force in unloading, number of outliers,
#: force at rest relative to the largest force.
TOE, LOSS, OUTLIERS, AT_REST = (0.5, 4.0), (0.1, 0.4), (1, 4), (0.02, 0.15)

#: Number of files by group: judged, and with which constants were chosen.  Those of
#: clean and contaminated files were doubled when the first 150 had been judged.
NUMBERS = {"clean": 300, "contaminated": 300, "force at rest": 60}
CHOSEN = dict.fromkeys(GROUPS, 60)

# Outliers: readings of an overload in N, or multiples of the noise.
_OVERLOADS, _MULTIPLES = (99999.0, -9999.0), (12.0, 60.0)

#: Noise relative to the largest force.
NOISE = (0.01, 0.05)

#: Shear angles in degrees at which a law is compared with its band.
ANGLES = (5, 10, 20, 30, 39)

# Largest shear angle of the tests in degrees, at most the angle up to which the moment
# of a law increases, and number of rows of a loading.
_REACH, _RISES, _ROWS = (42.0, 50.0), {"sin2": 45.0}, (80, 240)

# Largest difference of a reading from what was written, relative to the largest value:
# digits of the file.
_READ = 1e-3

#: Files that allow two readings, or lack what is needed, with a part of the message.
DOUBTFUL = {
    "no unit of the force": "--unit",
    "1,234": "--decimal",
    "two displacements": "--column",
}


@dataclass(frozen=True)
class File:
    """A raw file of a group, drawn at random by a seed.

    Constants of the library were chosen with other files than those that are judged.
    """

    seed: int
    group: str
    judged: bool = True

    def __str__(self) -> str:
        return f"{'judged' if self.judged else 'chosen'}: {self.group}, {self.seed}"

    @cached_property
    def rng(self) -> np.random.Generator:
        """Random numbers of this file, different for chosen and judged ones."""
        group = GROUPS.index(self.group)
        return np.random.default_rng((self.seed, group, self.judged))

    def rows(self) -> list[Row]:
        """Check that the file is read as written, and the law within its band."""
        drawn = _drawn(self)
        row: Row = {"group": self.group, "judged": self.judged, **drawn.description}
        with TemporaryDirectory() as folder:
            path = Path(folder) / "test.csv"
            path.write_bytes(drawn.export.written(drawn.curves))
            try:
                row |= {"misread": _misread(path, drawn)}
                row |= _fitted(path, drawn)
            except ValueError as error:
                row["refused"] = str(error).replace(folder, "")
        return [row]


@dataclass(frozen=True)
class _Drawn:
    """Content of a file."""

    law: Law
    name: str
    test: ShearTest
    export: Export
    curves: tuple[Curve, ...]
    description: dict[str, Any]


def _drawn(file: File) -> _Drawn:
    rng = file.rng
    machine = list(MACHINES)[file.seed % len(MACHINES)]
    export = Export.drawn(machine, rng)
    name = str(rng.choice(list(LAWS)))
    values = rng.uniform(0.5, 2.0) * np.array(rng.permutation(LAWS[name])[0])
    law = SHEAR_LAWS[name](1.0, 5, 0).build(values)
    test: ShearTest
    if rng.random() < 0.5:
        width = float(rng.choice([50.0, 100.0, 150.0]))
        test = BiasExtension(width, width * float(rng.choice([2.0, 3.0])))
    else:
        side = float(rng.choice([150.0, 200.0, 300.0]))
        test = PictureFrame(side, side * float(rng.choice([0.6, 0.8, 1.0])))
    has = {
        what: file.group == "contaminated" and bool(rng.random() < _SHARE)
        for what in CONTAMINATIONS
    }
    if file.group == "contaminated" and not any(has.values()):
        has[str(rng.choice(CONTAMINATIONS))] = True
    has["force at rest"] = file.group == "force at rest"
    has["toe"] |= has["force at rest"]
    noise, repeats = float(rng.uniform(*NOISE)), int(rng.integers(1, 4))
    rises = _RISES.get(name, np.inf)
    curves = tuple(_curve(test, law, rises, noise, has, rng) for _ in range(repeats))
    described = {
        **{"machine": machine, "separator": repr(export.separator)},
        **{"decimal": repr(export.decimal), "encoding": export.encoding},
        **{"force_unit": export.force_unit, "length_unit": export.length_unit},
        **{"sign": export.sign, "law": name, "test": type(test).__name__},
        **{"repeats": repeats, "noise": noise},
        **{what.replace(" ", "_"): found for what, found in has.items()},
    }
    return _Drawn(law, name, test, export, curves, described)


def _curve(
    test: ShearTest,
    law: Law,
    rises: float,
    noise: float,
    has: dict[str, bool],
    rng: np.random.Generator,
) -> Curve:
    """Displacements and forces of one specimen, as recorded."""
    toe = float(rng.uniform(*TOE)) if has["toe"] else 0.0
    angle = np.radians(min(rng.uniform(*_REACH), rises))
    end = toe + float(test.displacement(angle))
    moved = np.linspace(0.0, end, int(rng.integers(*_ROWS)))
    force = test.force(law, test.shear_angle(np.maximum(moved - toe, 0.0)))
    most = float(force.max())
    if has["hysteresis"]:
        loss = float(rng.uniform(*LOSS))
        back = moved[-2::-1]
        moved = np.concatenate([moved, back])
        force = np.concatenate([force, (1 - loss) * force[-2::-1]])
    if has["force at rest"]:
        force = force + most * float(rng.uniform(*AT_REST))
    force = force + noise * most * rng.standard_normal(force.size)
    if has["outliers"]:
        wrong = rng.choice(force.size, int(rng.integers(*OUTLIERS)), replace=False)
        for i in wrong:
            overload = rng.random() < 0.5
            times = float(rng.choice([-1, 1]) * rng.uniform(*_MULTIPLES))
            far = float(rng.choice(_OVERLOADS))
            force[i] = far if overload else force[i] + times * noise * most
    return moved, force


def _misread(path: Path, drawn: _Drawn) -> bool:
    """True if a recording differs from the curve that was written."""
    recordings = read_recordings(path)
    if len(recordings) != len(drawn.curves):
        return True
    for recording, curve in zip(recordings, drawn.curves, strict=True):
        for name, written in zip(("displacement", "force"), curve, strict=True):
            read = recording.columns[name]
            if read.shape != written.shape:
                return True
            if np.abs(read - written).max() > _READ * np.median(np.abs(written)):
                return True
    return False


def _fitted(path: Path, drawn: _Drawn) -> Row:
    """The law of the file against the known one."""
    specimens = read_specimens(path, drawn.test)
    fit = fit_tests(specimens, Choice(drawn.name)).parts["shear"]
    gamma = np.radians(ANGLES)

    def value(law: Law) -> ndarray:
        return law.value(gamma)

    truth = value(drawn.law)
    low, high = fit.band(value)
    inside = (low <= truth) & (truth <= high)
    found = {f"inside_{a}": bool(x) for a, x in zip(ANGLES, inside, strict=True)}
    error = np.abs(value(fit.law) / truth - 1)
    left_out = [x for s in specimens for x in s.statements if "outliers" in x]
    return {
        **found,
        "width": float(np.median((high - low) / truth)),
        "error": float(np.median(error)),
        "free": " and ".join(sorted(fit.free)),
        "outliers_stated": len(left_out),
        "beyond_noise": fit.beyond_noise,
    }


@dataclass(frozen=True)
class Doubtful:
    """A file that must be refused."""

    what: str
    machine: str

    def __str__(self) -> str:
        return f"doubtful: {self.what}, {self.machine}"

    def rows(self) -> list[Row]:
        """Check that the file is refused with the option that decides."""
        rng = np.random.default_rng(list(MACHINES).index(self.machine))
        export = Export.drawn(self.machine, rng)
        moved = np.linspace(0.0, 30.0, 60)
        content = export.written([(moved, 2 * moved)])
        if self.what == "no unit of the force":
            content = export.written([(moved, 2 * moved)], with_units=False)
        elif self.what == "1,234":
            lines = [f"{1.111 + x:.3f};{1.234 + 2 * x:.3f}" for x in moved]
            head = "displacement (mm);force (N)"
            content = "\n".join([head, *(x.replace(".", ",") for x in lines)]).encode()
        else:
            lines = [f"{x:.4f};{0.9 * x:.4f};{2 * x:.4f}" for x in moved]
            head = "crosshead (mm);extension (mm);force (N)"
            content = "\n".join([head, *lines]).encode()
        with TemporaryDirectory() as folder:
            path = Path(folder) / "test.csv"
            path.write_bytes(content)
            try:
                read_recordings(path)
                message = ""
            except ValueError as error:
                message = str(error).replace(folder, "")
        option = DOUBTFUL[self.what]
        return [{"what": self.what, "as_needed": option in message, "message": message}]


Case = File | Doubtful | JointCase | Repeats


def all_cases(seed: int) -> Sequence[Case]:
    """Files of each group, files that must be refused, joint fits, and repeats.

    The files ``chosen`` are those with which constants of the library were chosen.
    """
    return [
        *(
            File(first + i, group, judged)
            for judged, first, numbers in ((True, seed, NUMBERS), (False, 0, CHOSEN))
            for group, number in numbers.items()
            for i in range(number)
        ),
        *(Doubtful(what, machine) for what in DOUBTFUL for machine in MACHINES),
        *joint_cases(),
        *repeats_cases(),
    ]
