"""Curves of tests in CSV files, and files of tests, for the command ``fit``."""

import numpy as np

from tests.helpers.fits import BIAS, QUINTIC, noisy

BIAXIAL = "warp strain (-),warp force (N),weft strain (-),weft force (N)"

#: Strips along warp and weft, a bias extension and an overhanging strip.
TESTS = {
    "warp": 'kind = "strip"\ndata = "warp.csv"\nwidth = 50\nlength = 200',
    "weft": 'kind = "strip"\ndata = "weft.csv"\nwidth = 50\nlength = 200\n'
    'family = "weft"',
    "bias": 'kind = "bias-extension"\ndata = ["0.csv"]\nwidth = 100\nheight = 200',
    "bend": 'kind = "cantilever"\ndata = "bend.csv"\nweight = 6e-6\nchord_angle = 41.5',
}


def write_columns(path, header, *columns):
    rows = zip(*map(np.atleast_1d, columns), strict=True)
    lines = [header, *(",".join(f"{x:.9g}" for x in row) for row in rows)]
    path.write_text("\n".join(lines))
    return path


def shear_file(path, test=BIAS, law=QUINTIC, seed=0, share=0.005, n=40):
    """The curve of a test to 40 degrees."""
    gamma = np.radians(np.linspace(1.0, 40.0, n))
    force = noisy(test.force(law, gamma), share, seed)
    header = "displacement (mm),force (N)"
    return write_columns(path, header, test.displacement(gamma), force)


def shear_files(folder, test=BIAS, law=QUINTIC, n=3, share=0.02):
    """Curves of n specimens."""
    files = (folder / f"{i}.csv" for i in range(n))
    return [shear_file(file, test, law, i, share) for i, file in enumerate(files)]


def joint_file(folder, law, names=tuple(TESTS), share=0.0):
    """A file of tests with their data; fibres have one tension law."""
    moved = np.linspace(0.0, 4.0, 40)
    force = 50 * law.value(np.log1p(moved / 200)) / (1 + moved / 200)
    for seed, family in enumerate(("warp", "weft")):
        force_of = noisy(force, share, seed)
        header = "displacement (mm),force (N)"
        write_columns(folder / f"{family}.csv", header, moved, force_of)
    shear_file(folder / "0.csv")
    write_columns(folder / "bend.csv", "overhang (mm)", [200.0, 201.0, 199.5])
    file = folder / "tests.toml"
    file.write_text("\n".join(f"[[test]]\n{TESTS[name]}" for name in names))
    return file
