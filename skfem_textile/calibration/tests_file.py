"""Files that list tests of several kinds, and readers of each kind."""

import argparse
import os
import tomllib
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..declarations.words import OF_FILES, Options
from ..mesh.user_input import errors_in, printable, refuse_unknown
from ..scenes.shear_test import BiasExtension, PictureFrame
from .bending import read_bending, read_cantilever
from .choice import Test
from .preparing import Preparation
from .reading import Format, column_named
from .specimens import read_specimens
from .tensile import read_biaxial, read_strips


def _strips(options: Namespace) -> list[Test]:
    sizes = _sizes(options, "width", "length")
    return _read(options, read_strips, [(options.family, *size) for size in sizes])


def _frames(options: Namespace) -> list[Test]:
    sizes = _sizes(options, "frame_side", "fabric_side")
    return _read(options, read_specimens, [(PictureFrame(*size),) for size in sizes])


def _biases(options: Namespace) -> list[Test]:
    theta = float(np.radians(options.warp))
    sizes = _sizes(options, "width", "height")
    tests = [(BiasExtension(*size, theta),) for size in sizes]
    return _read(options, read_specimens, tests)


def _biaxials(options: Namespace) -> list[Test]:
    sizes = _sizes(options, "warp_width", "weft_width")
    return _read(options, read_biaxial, [(size,) for size in sizes])


def _read(
    options: Namespace,
    reader: Callable[..., Sequence[Test]],
    arguments: Sequence[tuple[Any, ...]],
) -> list[Test]:
    """Tests of all files, each read with its arguments."""
    how = _format(options), _preparation(options)
    pairs = zip(options.data, arguments, strict=True)
    return [test for path, given in pairs for test in reader(path, *given, *how)]


def _cantilevers(options: Namespace) -> list[Test]:
    if options.weight is None:
        raise ValueError("--weight is missing: specify the weight per area in N/mm2")
    form, angle = _format(options), options.chord_angle
    fixed = None if angle is None else float(np.radians(angle))
    return [
        test
        for path in options.data
        for test in read_cantilever(path, options.weight, options.family, fixed, form)
    ]


def _bendings(options: Namespace) -> list[Test]:
    return _read(options, read_bending, [(options.family,)] * len(options.data))


#: Functions that read the files of a kind of test.
READERS: dict[str, Callable[[Namespace], Sequence[Test]]] = {
    "strip": _strips,
    "picture-frame": _frames,
    "bias-extension": _biases,
    "biaxial": _biaxials,
    "cantilever": _cantilevers,
    "bending": _bendings,
}

# Keys of a test in a file besides the options of its kind.
_KEYS = "kind", "data"


def read_tests(path: str | os.PathLike[str]) -> list[Test]:
    r"""Tests of a file in TOML, as for ``skfem-textile fit joint``.

    The file consists of a table ``[[test]]`` for each kind of test, with its ``kind``,
    the files or folders ``data``, relative to it, and options of the command ``fit
    KIND``, with underscores in their names.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    list of Specimen, Strip, BiaxialCurve, CantileverTest or BendingCurve
        The tests in the order of the tables, for `fit_tests` or `validate`.

    Raises
    ------
    ValueError
        If the file is not valid, or see `read_recordings` and `prepare`.
    OSError
        If a file cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> _ = Path("bend.csv").write_text("overhang (mm)\n200\n201\n199.5\n")
    >>> test = "kind = 'cantilever'\ndata = 'bend.csv'\nweight = 6e-6\nchord_angle = 40"
    >>> _ = Path("tests.toml").write_text(f"[[test]]\n{test}\n")
    >>> from skfem_textile.calibration import fit_tests, read_tests
    >>> laws = fit_tests(read_tests("tests.toml")).laws
    >>> print(f"{laws['bending warp'].stiffness:.2f} N·mm")
    6.40 N·mm
    """
    name = printable(path)
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{name}: the file is not valid TOML: {error}") from None
    tables = content.get("test")
    valid = set(content) == {"test"} and isinstance(tables, list)
    if not (valid and all(isinstance(one, dict) for one in tables or ())):
        raise ValueError(
            f"{name}: the file must consist of tables [[test]], each with kind and data"
        )
    tests: list[Test] = []
    for i, table in enumerate(tables or (), 1):
        where = f"{name}, test {i}"
        kind, data = table.get("kind"), table.get("data")
        if kind not in READERS:
            raise ValueError(
                f"{where}: the kind must be one of {', '.join(READERS)}, got {kind!r}"
            )
        paths = data if isinstance(data, list) else [data]
        if not paths or not all(isinstance(one, str) for one in paths):
            raise ValueError(f"{where}: data must be the name of a file, or a list")
        options = _options(where, OF_FILES[kind], table)
        options.data = [Path(path).parent / one for one in paths]
        try:
            found = READERS[kind](options)
        except ValueError as error:
            text = str(error)
            known = text.startswith(tuple(map(printable, options.data)))
            raise ValueError(text if known else f"{where}: {text}") from None
        tests += found
    return tests


def _options(where: str, known: Options, table: Mapping[str, Any]) -> Namespace:
    """Options of a kind with the values of a table."""
    flags = {flag[2:].replace("-", "_"): flag for flag in known}
    values = {key: known[flag].get("default") for key, flag in flags.items()}
    for key, value in table.items():
        if key in _KEYS:
            continue
        with errors_in(f"{where}: "):
            refuse_unknown("key", key, flags)
        values[key] = _converted(f"{where}, {key}", known[flags[key]], value)
    return Namespace(**values)


def _converted(where: str, keywords: Mapping[str, Any], value: Any) -> Any:
    """Value of an option, converted as on the command line."""
    if keywords.get("action") == "store_true":
        if not isinstance(value, bool):
            raise ValueError(f"{where}: must be true or false, got {value!r}")
        return value
    several = "nargs" in keywords or keywords.get("action") == "append"
    given = value if isinstance(value, list) else [value]
    if len(given) != 1 and not several:
        raise ValueError(f"{where}: must be a single value, got {value!r}")
    try:
        found = [keywords.get("type", str)(str(one)) for one in given]
    except (ValueError, argparse.ArgumentTypeError) as error:
        raise ValueError(f"{where}: {error}") from None
    choices = keywords.get("choices")
    if choices and not set(found) <= set(choices):
        raise ValueError(f"{where}: must be one of {', '.join(choices)}, got {value!r}")
    return found if several else found[0]


def _preparation(options: Namespace) -> Preparation:
    return Preparation(
        options.branch,
        options.cycle,
        getattr(options, "slack", None),
        getattr(options, "force_at_rest", None),
        not options.keep_outliers,
        getattr(options, "cycles", False),
    )


def _format(options: Namespace) -> Format:
    columns, units, signs = (
        {column_named(name): value for name, value in given}
        for given in (options.column, options.unit, options.sign)
    )
    return Format(
        *(options.encoding, options.separator, options.decimal, columns, units, signs)
    )


def _sizes(options: Namespace, *keys: str) -> list[tuple[float, float]]:
    """Two sizes of the specimen for each file."""
    n, columns = len(options.data), []
    for key in keys:
        sizes, name = getattr(options, key), f"--{key.replace('_', '-')}"
        if sizes is None:
            raise ValueError(
                f"{name} is missing: specify the size of the specimens in mm"
            )
        if len(sizes) not in (1, n):
            raise ValueError(
                f"{name} has {len(sizes)} values for {n} files: specify one for all "
                "files, or one for each"
            )
        columns.append(sizes * n if len(sizes) == 1 else sizes)
    first, second = columns
    return list(zip(first, second, strict=True))
