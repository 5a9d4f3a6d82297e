"""Tables of command-line options and of keys of case files, from their declarations."""

import re
from argparse import Action, ArgumentParser, HelpFormatter, _SubParsersAction
from collections.abc import Iterable, Iterator
from functools import cache

from skfem_textile.cases.write import reference
from skfem_textile.cli.main import command_parser

# A whole line: ``OPTIONS-OF command: group`` or ``KEYS-OF table: choices``,
# where the choices may be missing.
_OPTIONS = re.compile(r"^OPTIONS-OF ([^:\n]*): (.*)$", re.MULTILINE)
_KEYS = re.compile(r"^KEYS-OF ([^:\n]*)(?:: (.*))?$", re.MULTILINE)


def filled(text: str) -> str:
    """The text of a page, with a table in place of each marker."""
    text = _OPTIONS.sub(lambda match: _options(*match.groups()), text)
    return _KEYS.sub(lambda match: _keys(match[1], (match[2] or "").split()), text)


def _options(command: str, group: str) -> str:
    """Table of a group of options, in the words of ``--help``."""
    parser = parser_of(command)
    formatter = parser._get_formatter()
    groups = {own.title: own._group_actions for own in parser._action_groups}
    rows = (
        (f"`{_breakable(formatter, x)}`", formatter._expand_help(x))
        for x in groups[group]
    )
    return _table(("option", "meaning"), rows)


def _breakable(formatter: HelpFormatter, action: Action) -> str:
    """Option with its value; a list of choices may continue on the next line."""
    return re.sub(r"(?<=\w),(?=\w)", ", ", formatter._format_action_invocation(action))


def parser_of(command: str) -> ArgumentParser:
    """Parser of a command, such as ``run strip``."""
    parser = _whole_parser()
    for name in command.split():
        parser = commands_of(parser)[name]
    return parser


def commands_of(parser: ArgumentParser) -> dict[str, ArgumentParser]:
    """Parsers of the subcommands by name."""
    actions = (x for x in parser._actions if isinstance(x, _SubParsersAction))
    return {name: own for action in actions for name, own in action.choices.items()}


@cache
def _whole_parser() -> ArgumentParser:
    return command_parser()


def _keys(table: str, choices: list[str]) -> str:
    """Keys of a table; keys that several choices share are one row."""
    shared: dict[tuple[str, ...], list[str]] = {}
    for entry in reference():
        if entry.table == table and (not choices or entry.choice in choices):
            row = entry.key, entry.kind, entry.default, entry.about
            shared.setdefault(row, []).append(entry.choice)
    every = {choice for own in shared.values() for choice in own} - {""}
    rows = (
        (
            f"`{key}`{_only(own, every)}",
            kind,
            f"`{default}`" if default else "",
            about,
        )
        for (key, kind, default, about), own in shared.items()
    )
    return _table(("key", "type", "default", "meaning"), rows)


def _only(choices: list[str], every: set[str]) -> str:
    """The choices to which a key belongs, unless it belongs to all."""
    if choices == [""] or set(choices) == every:
        return ""
    return f" ({', '.join(choices)})"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    return "\n".join(_lines([*head], rows))


def _lines(head: list[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    yield "| " + " | ".join(head) + " |"
    yield "|---" * len(head) + "|"
    for row in rows:
        yield "| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |"
