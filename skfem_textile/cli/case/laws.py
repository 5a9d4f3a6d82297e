"""Laws of tension and shear, as a case chooses them."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from ...fabric.laws import LAWS
from ...fabric.laws.linear import STIFFNESS
from ...fabric.laws.one_sided import COMPRESSION
from ...registration import LawRegistration, Option, Registration, Resistance, angle
from .table import Table

# What the names of the options of tension and shear laws begin with.
PREFIXES: dict[Resistance, str] = {"tension": "fibre-", "shear": "shear-"}

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
    laws, prefix = laws_of(of), PREFIXES[of]
    word = Option(
        name=f"{of}-law",
        help=described(laws),
        default="linear",
        read=partial(_law_word, of),
        metavar="LAW",
        names_file=lambda word: _is_law_file(of, word),
    )
    beside: tuple[Option, ...] = (COMPRESSION,) if of == "tension" else ()
    every = (*own_options(laws), *beside)

    def applies(chosen: str, option: Option) -> bool:
        law = laws[law_name(of, chosen) or chosen]
        own = (*law.options, *beside)
        return option.name in {prefix + one.name for one in own}

    named = (replace(option, name=prefix + option.name) for option in every)
    return Table(of, (word, *named), "law", prefix, applies)


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
