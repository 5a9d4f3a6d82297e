"""Recordings in segments, of several specimens, or of noise are read or refused."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from skfem_textile import Linear, Polynomial, Sin2
from skfem_textile.calibration import (
    BiasExtension,
    Choice,
    PictureFrame,
    fit_tests,
    read_specimens,
    read_strips,
)
from tests.helpers.hostile import (
    RIGHT,
    Family,
    WrongAnswerError,
    expect,
    expect_equal,
    rejected,
    seeds,
)

LAWS = {
    "linear": Linear(0.1),
    "sin2": Sin2(0.3),
    "polynomial": Polynomial((0.3, 0.0, -0.3, 0.0, 0.6)),
}
TENSION = Linear(40.0)
WIDTH, LENGTH = 50.0, 200.0

# Arguments at which a law is compared with its band.
ANGLES, STRAINS = np.radians([10.0, 20.0, 30.0, 38.0]), np.array([0.01, 0.04])

# Relative error of a law that its band must contain.
LARGE = 0.1

# Names of displacement, force and clock, by language; factors from mm and N.
NAMES = (
    ("Displacement", "Force", "Time"),
    ("Crosshead", "Load", "Time"),
    ("Weg", "Kraft", "Zeit"),
    ("Déplacement", "Charge", "Temps"),
)
LENGTHS, FORCES = {"mm": 1.0, "cm": 0.1, "in": 1 / 25.4}, {"N": 1.0, "kN": 1e-3}

VALID = "one table", "segments", "several specimens", "segments of specimens"
INVALID = {
    "displacement of noise": "contains noise, not displacement",
    "wandering displacement": "contains noise, not displacement",
    "constant displacement": "contains noise, not displacement",
    "force of noise": "contains noise",
}


class Recorded(NamedTuple):
    """A recording of this kind, drawn by a seed."""

    kind: str
    seed: int

    def __str__(self) -> str:
        return f"{self.kind}, seed {self.seed}"


class Style:
    """Language, units, separator and segments of a file at random."""

    def __init__(self, rng):
        self.names = NAMES[rng.integers(len(NAMES))]
        self.units = str(rng.choice([*LENGTHS])), str(rng.choice([*FORCES])), "s"
        self.separator, self.mark = [(";", ","), ("\t", "."), (",", "."), ("\t", ",")][
            rng.integers(4)
        ]
        self.row_of_units = rng.random() < 0.5
        self.between = ("", "\f", "Page {}", "Data Acquisition\tTime: {}.0 Sec")[
            rng.integers(4)
        ]
        self.titled, self.timed = rng.random() < 0.5, rng.random() < 0.5
        self.every = int(rng.integers(40, 130))

    def heading(self):
        names = self.names if self.timed else self.names[:2]
        units = self.units[: len(names)]
        if self.row_of_units:
            return [self.separator.join(names), self.separator.join(units)]
        pairs = zip(names, units, strict=True)
        return [self.separator.join(f"{name} ({unit})" for name, unit in pairs)]

    def rows(self, moved, force):
        columns = [moved * LENGTHS[self.units[0]], force * FORCES[self.units[1]]]
        columns += [0.1 * np.arange(moved.size)] * self.timed
        lines = (
            self.separator.join(f"{x:.7f}".replace(".", self.mark) for x in row)
            for row in zip(*columns, strict=True)
        )
        return [*lines]

    def written(self, curves, in_segments):
        lines = []
        for i, curve in enumerate(curves):
            rows = self.rows(*curve)
            every = self.every if in_segments else len(rows)
            for k, begin in enumerate(range(0, len(rows), every)):
                if self.titled and not k and len(curves) > 1:
                    lines.append(f"Specimen {i + 1}")
                if k:
                    lines.append(self.between.format(k + 1))
                lines += [*self.heading(), *rows[begin : begin + every], ""]
        Path("test.txt").write_text("\n".join(lines), encoding="utf-8")


def machine(rng, largest, force_of):
    """Displacement and force of a specimen with noise, perhaps slack and unloading."""
    slack = rng.uniform(0.02, 0.06) * largest * (rng.random() < 0.5)
    moved = np.linspace(0.0, largest + slack, int(rng.integers(120, 320)))
    force = force_of(np.maximum(moved - slack, 0.0))
    size = force.max()
    if rng.random() < 0.5:
        back = (1 - rng.uniform(0.1, 0.4)) * force[::-1]
        moved, force = np.append(moved, moved[::-1]), np.append(force, back)
    return moved, force + rng.uniform(0.0, 0.03) * size * rng.standard_normal(
        moved.size
    )


def spoilt(kind, rng, moved, force):
    """Curve with a column of noise."""
    noise = rng.standard_normal(moved.size)
    if kind == "displacement of noise":
        return 0.1 + 0.02 * noise, force
    if kind == "constant displacement":
        return np.full(moved.size, 1.25), force
    if kind == "wandering displacement":
        return 0.1 + 0.05 * np.sin(np.arange(moved.size) / 5) + 0.01 * noise, force
    return moved, 0.3 + 0.2 * noise


def attempt(recorded):
    rng = np.random.default_rng(recorded.seed)
    style, kind = Style(rng), recorded.kind
    is_strip = rng.random() < 1 / 3
    name, law = str(rng.choice([*LAWS])), TENSION
    test = (PictureFrame(200.0, 160.0), BiasExtension(100.0, 200.0))[rng.integers(2)]
    if is_strip:
        largest = 0.06 * LENGTH

        def force_of(moved):
            return WIDTH * TENSION.value(x := np.log1p(moved / LENGTH)) / np.exp(x)
    else:
        law, largest = LAWS[name], float(test.displacement(np.radians(44.0)))

        def force_of(moved):
            return test.force(law, test.shear_angle(moved))

    number = int(rng.integers(2, 4)) if "specimens" in kind else 1
    curves = [machine(rng, largest, force_of) for _ in range(number)]
    if kind in INVALID:
        curves = [spoilt(kind, rng, *curves[0])]
    style.written(curves, "segments" in kind or (kind in INVALID and style.titled))
    try:
        tests = (
            read_strips("test.txt", "warp", WIDTH, LENGTH)
            if is_strip
            else read_specimens("test.txt", test)
        )
        fits = fit_tests(tests, Choice(name, "linear")).parts
    except ValueError as error:
        if kind in INVALID and INVALID[kind] in str(error):
            return rejected(error)
        raise WrongAnswerError(f"{kind}: refused: {error}") from None
    expect(kind not in INVALID, f"{kind}: accepted")
    expect_equal("number of tests", len(tests), number)
    fit = fits["warp" if is_strip else "shear"]
    compare(fit, law, STRAINS if is_strip else ANGLES)
    return RIGHT


def compare(fit, law, at):
    """The law is near its band, and within 10 % of the truth or in the band."""
    known = law.value(at)
    low, high = fit.band(lambda other: other.value(at))
    outside = np.maximum(np.maximum(low - known, known - high), 0.0)
    expect(np.all(outside <= high - low), f"outside of the band {low} {high}: {known}")
    error = np.abs(fit.law.value(at) / known - 1)
    said = (error <= LARGE) | (outside == 0)
    expect(np.all(said), f"off by {error.max():.0%} outside of the band")


FAMILY = Family(
    "recordings",
    {kind: st.builds(Recorded, st.just(kind), seeds) for kind in (*VALID, *INVALID)},
    attempt,
    trials=160,
)


def test_recordings_are_read_as_measured_or_refused():
    FAMILY.check(3)


def test_the_largest_angle_of_a_specimen_is_beyond_its_fitted_slack(
    tmp_path, monkeypatch
):
    """Sin2 decreases beyond 45 degrees; the data end at 44, and at 46 with a slack."""
    monkeypatch.chdir(tmp_path)
    assert attempt(Recorded("several specimens", 837337)) == RIGHT
