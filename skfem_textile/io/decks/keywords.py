"""Keywords of Abaqus with their parameters and data lines."""

import re
from collections.abc import Iterator
from typing import NamedTuple

from ...mesh.checks import MeshError
from ...mesh.user_input import printable


class Block(NamedTuple):
    """A keyword, its parameters, and the words of its data lines."""

    keyword: str
    parameters: dict[str, str]
    data: list[list[bytes]]

    def __str__(self) -> str:
        name = self.parameters.get(self.keyword)
        return f"*{printable(self.keyword)}" + (f" {name!r}" if name else "")


def blocks(content: bytes) -> Iterator[Block]:
    """All keywords, each with its data."""
    lines = re.split(rb"\r\n|\n|\r", content)
    stripped = (line.strip() for line in lines)
    lines = [line for line in stripped if line and not line.startswith(b"**")]
    starts = [i for i, line in enumerate(lines) if line.startswith(b"*")]
    if starts[:1] != [0]:
        raise MeshError("it does not begin with a keyword of Abaqus")
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        first, head = start + 1, lines[start][1:]
        while head.endswith(b",") and first < end:
            head, first = head + lines[first], first + 1
        keyword, *words = head.decode(errors="replace").split(",")
        pairs = [word.partition("=") for word in words if word.strip()]
        parameters = {key.strip().upper(): value.strip() for key, _, value in pairs}
        data = [
            [word.strip() for word in line.split(b",")] for line in lines[first:end]
        ]
        block = Block(" ".join(keyword.upper().split()), parameters, data)
        if len(parameters) < len(pairs):
            raise MeshError(f"{block} has a parameter twice")
        yield block
