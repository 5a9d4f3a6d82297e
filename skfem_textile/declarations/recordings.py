"""Options of the files of tests, which are also the keys of a file of tests."""

from typing import Any, TypeAlias

from . import words

# Options of a command: keywords of `argparse` by flag.
Options: TypeAlias = dict[str, dict[str, Any]]


def option(
    text: str, of: Any = None, metavar: str | tuple[str, ...] | None = None, **more: Any
) -> dict[str, Any]:
    """Keywords of an option; its help ends with its default, if any."""
    default = " (default: %(default)s)" if more.get("default") else ""
    keywords = {"help": text + default, "type": of, "metavar": metavar, **more}
    return {key: value for key, value in keywords.items() if value is not None}


def repeated(text: str, of: Any, metavar: str) -> dict[str, Any]:
    """Keywords of an option that may be repeated."""
    return option(text, of, metavar, action="append", default=[])


def _size(what: str) -> dict[str, Any]:
    """Option for a specimen size: one value for all files, or one for each."""
    return option(
        f"{what} in mm: one value for all files, or one for each",
        float,
        "MM",
        nargs="+",
    )


_READING: Options = {
    "--encoding": option("encoding of the files (default: from their bytes)"),
    "--separator": option(
        "separator of the columns: ; , | tab or space (default: from the rows)"
    ),
    "--decimal": option("decimal mark (default: from the numbers)", choices=(".", ",")),
    "--column": repeated(
        "column of a quantity, by number or heading (default: from the headings); may "
        "be repeated",
        words.column,
        "COLUMN=NUMBER",
    ),
    "--unit": repeated(
        "unit of a quantity (default: from the headings); may be repeated",
        words.unit,
        "COLUMN=UNIT",
    ),
    "--sign": repeated(
        "factor 1 or -1 of a quantity (default: forces are positive at the largest "
        "displacement); may be repeated",
        words.sign,
        "COLUMN=SIGN",
    ),
}

_BRANCH: Options = {
    "--branch": option(
        "rows that are fitted: loading, unloading or both",
        choices=("loading", "unloading", "both"),
        default="loading",
    ),
    "--cycle": option(
        "number of the fitted cycle (default: the first one that reaches the largest "
        "displacement)",
        int,
        "N",
    ),
    "--keep-outliers": option("fit also outliers", action="store_true"),
}

_SLACK: Options = {
    "--slack": option(
        "displacement at which the fabric begins to carry load; for tests without "
        "displacement 0 or none (default: estimated)",
        float,
        "MM",
    ),
}

_AT_REST: Options = {
    "--force-at-rest": option(
        "force of the undeformed fabric, such as the weight of a clamp (default: "
        "estimated)",
        float,
        "N",
    ),
}

_FAMILY: Options = {
    "--family": option(
        "fibre family along the strips", default="warp", choices=("warp", "weft")
    )
}

#: Options of the files of each kind of test.
OF_FILES: dict[str, Options] = {
    "strip": {
        **_FAMILY,
        "--width": _size("width of the strip"),
        "--length": _size("length of the strip between the clamps"),
        **_READING,
        **_BRANCH,
        **_SLACK,
    },
    "picture-frame": {
        "--frame-side": _size("side of the frame from hinge to hinge"),
        "--fabric-side": _size("side of the sheared square of fabric"),
        **_READING,
        **_BRANCH,
        **_SLACK,
        **_AT_REST,
    },
    "bias-extension": {
        "--width": _size("width of the specimen"),
        "--height": _size("height of the specimen between the clamps"),
        "--warp": option(
            "angle between fibres and clamps", words.degrees, "DEG", default=45.0
        ),
        **_READING,
        **_BRANCH,
        **_SLACK,
        **_AT_REST,
    },
    "biaxial": {
        "--warp-width": _size("width of the specimen transverse to the warp force"),
        "--weft-width": _size("width of the specimen transverse to the weft force"),
        **_READING,
        **_BRANCH,
        **_SLACK,
    },
    "cantilever": {
        "--weight": option(
            "weight per area in N/mm2, such as 6e-6 for 0.6 kg/m2", float, "W"
        ),
        **_FAMILY,
        "--chord-angle": option(
            "chord angle of all readings, for files without that column, such as 41.5",
            words.degrees,
            "DEG",
        ),
        **_READING,
    },
}
