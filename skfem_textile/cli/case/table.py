"""The tables of a case file, made of options."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from ...registration import Option


@dataclass(frozen=True)
class Table:
    """Options that stand together in a case file.

    Attributes
    ----------
    name
        Its name in the file.
    options
        The options, the one that chooses among things by name first if there is one.
    chooser
        What that one is called in the file; empty if there is none.
    prefix
        What the names of the others begin with, which is left out in the file.
    applies
        Whether an option says anything beside what is chosen: ``(word, option)``.
    parts
        Tables within it, each of which may be left out.
    entry, about
        Of a table within another, its key among the values, where it is a mapping or
        None, and what it is, for a comment.
    """

    name: str
    options: tuple[Option, ...]
    chooser: str = ""
    prefix: str = ""
    applies: Callable[[str, Option], bool] = lambda word, option: True
    parts: tuple["Table", ...] = ()
    entry: str = ""
    about: str = ""

    def key(self, option: Option) -> str:
        """What an option is called in the file, with its unit."""
        if self.chooser and option is self.options[0]:
            return self.chooser
        name = option.name.removeprefix(self.prefix).replace("-", "_")
        return f"{name}_{option.unit}" if option.unit else name

    @property
    def nothing(self) -> dict[str, Any]:
        """Values of a table of which nothing is said."""
        parts = dict.fromkeys(part.entry for part in self.parts)
        return {option.key: option.default for option in self.options} | parts

    def given(self, values: Mapping[str, Any]) -> tuple[Option, ...]:
        """The options that say anything beside the values of a case."""
        if not self.chooser:
            return self.options
        first, *others = self.options
        word = values[first.key]
        return first, *(o for o in others if self.applies(word, o))


#: The tables of a case of each scene, by its name.
Tables: TypeAlias = Mapping[str, Sequence[Table]]
