"""Laws of tension and shear, as a case chooses them."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from ...fabric.laws import LAWS
from ...fabric.laws.linear import STIFFNESS
from ...fabric.laws.one_sided import COMPRESSION
from ...fabric.laws.pretensioned import PRETENSION
from ...registration import LawRegistration, Option, Registration, Resistance, angle
from .table import Table

# What the names of the options of tension and shear laws begin with.
PREFIXES: dict[Resistance, str] = {"tension": "fibre-", "shear": "shear-"}

#: Entries of laws within the table of the tension.
OF_WEFT, IN_COMPRESSION = "weft_tension", "tension_in_compression"

#: Stiffnesses against bending of both families and against twist, which a region may
#: have of its own.
BENDING = Table(
    "bending",
    tuple(
        Option(
            name=f"bending-{name}",
            help=f"{what} per width of ply in N mm",
            default=0.0,
            read=float,
            metavar="D",
            unit="N_mm",
        )
        for name, what in (
            ("warp", "bending stiffness of the warp"),
            ("weft", "bending stiffness of the weft"),
            ("twist", "twist stiffness"),
        )
    ),
    prefix="bending-",
)

# Shear angle past which fibres wrinkle as soon as they are compressed.
_WRINKLING = angle(
    "wrinkling-angle",
    90.0,
    "shear angle past which fibres wrinkle as soon as they are compressed, for the "
    "wrinkle_risk of a ply on a tool",
)

#: Its key among the values of a case.
WRINKLING_ANGLE = "shear_wrinkling_angle"

# Parameters whose default is another for tension.
_OF_FIBRES = {STIFFNESS: replace(STIFFNESS, default=1e4, metavar="E")}

#: Inclinations of fibres, which a region may have of its own.
FIBRES = (
    angle("warp", None, "inclination of the warp, the scene's if not given"),
    angle("weft", None, "inclination of the weft, the scene's if not given"),
)


def laws_of(of: Resistance) -> dict[str, LawRegistration]:
    """The laws of tension or of shear, by name."""
    laws = {name: law for name, law in LAWS.items() if of in law.resists}
    if of == "shear":
        return laws
    return {
        name: replace(law, options=tuple(_OF_FIBRES.get(o, o) for o in law.options))
        for name, law in laws.items()
    }


def law_name(of: Resistance, word: str) -> str | None:
    """The name of the law that a word is, or that a file of this name has."""
    laws, ends = laws_of(of), word.lower().endswith
    files = [law.name for law in laws.values() if law.suffix and ends(law.suffix)]
    return files[0] if files else word if word in laws else None


def law_table(of: Resistance) -> Table:
    """The table of the law of tension or of shear."""
    if of == "shear":
        return _law_table(of, of, (_WRINKLING,))
    compressed = replace(
        _law_table(of, "in_compression"),
        entry=IN_COMPRESSION,
        about="the law of the fibres for negative strain",
    )
    beside = COMPRESSION, PRETENSION
    fibres = replace(_law_table(of, of, beside), parts=(compressed,))
    weft = replace(fibres, name="weft", entry=OF_WEFT, about="the law of the weft")
    return replace(fibres, parts=(compressed, weft))


def _law_table(of: Resistance, name: str, beside: tuple[Option, ...] = ()) -> Table:
    laws, prefix = laws_of(of), PREFIXES[of]
    word = Option(
        name=f"{of}-law",
        help=described(laws),
        default="linear",
        read=partial(_law_word, of),
        metavar="LAW",
        names_file=lambda word: _is_law_file(of, word),
    )
    every = (*own_options(laws), *beside)

    def applies(chosen: str, option: Option) -> bool:
        law = laws[law_name(of, chosen) or chosen]
        own = (*law.options, *beside)
        return option.name in {prefix + one.name for one in own}

    named = (replace(option, name=prefix + option.name) for option in every)
    return Table(name, (word, *named), "law", prefix, applies)


def own_options(among: Mapping[str, Registration]) -> tuple[Option, ...]:
    """The options that any of them has, each once."""
    return tuple({o.name: o for one in among.values() for o in one.options}.values())


def _is_law_file(of: Resistance, word: str) -> bool:
    name = law_name(of, word)
    return name is not None and bool(laws_of(of)[name].suffix)


def _law_word(of: Resistance, word: str) -> str:
    if law_name(of, word) is None:
        raise ValueError(f"{word!r} is none of {', '.join(laws_of(of))}")
    if _is_law_file(of, word) and not Path(word).is_file():
        raise ValueError(f"{word!r}: there is no such file")
    return word


def described(among: Mapping[str, Registration]) -> str:
    """Names and descriptions, for a help."""
    return "; ".join(f"{name}: {one.description}" for name, one in among.items())
