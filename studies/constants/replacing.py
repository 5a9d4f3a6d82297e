"""Constants of a package, and their replacement in all modules that use them."""

import ast
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from dis import get_instructions
from functools import cache
from importlib import import_module
from importlib.util import resolve_name
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, TypeAlias

import skfem_textile

PACKAGE = skfem_textile.__name__

#: A number, or a tuple of numbers that are scaled together.
Value: TypeAlias = float | tuple[float, ...]

# Modules whose numbers name options and errors of other libraries.
_CODES = ("pardiso", "petsc", "cholmod")


@dataclass(frozen=True)
class Constant:
    """A numeric constant of a module.

    Attributes
    ----------
    module
        Its module, relative to the package.
    name
        Its name.
    meaning
        First sentence of its comment.
    """

    module: str
    name: str
    meaning: str

    def __str__(self) -> str:
        return f"{self.module}.{self.name}"

    @property
    def value(self) -> Value:
        """Its value."""
        of = import_module(f"{PACKAGE}.{self.module}")
        value: Value = getattr(of, self.name)
        return value

    def times(self, factor: float) -> Value:
        """Its value times a factor: integers are rounded, and at least 1."""
        value = self.value
        if isinstance(value, tuple):
            return tuple(_times(x, factor) for x in value)
        return _times(value, factor)


def _times(value: float, factor: float) -> float:
    if not isinstance(value, int):
        return value * factor
    return max(round(value * factor), 1) if value > 0 else round(value * factor)


def constants(folders: tuple[str, ...]) -> Iterator[Constant]:
    """Numeric constants of packages other than 0, in the order of files and lines."""
    root = Path(skfem_textile.__file__).parent
    for folder in folders:
        for file in sorted((root / folder).rglob("*.py")):
            module = ".".join(file.relative_to(root).with_suffix("").parts)
            if file.stem not in _CODES:
                for name, meaning in _assigned(file.read_text(encoding="utf-8")):
                    constant = Constant(module.removesuffix(".__init__"), name, meaning)
                    if _is_numeric(constant.value):
                        yield constant


def _assigned(source: str) -> Iterator[tuple[str, str]]:
    """Upper-case names with the first sentence of the comment above, or of the line."""
    lines, meaning, last = source.split("\n"), "", 0
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign) or len(node.targets) != 1:
            continue
        above = node.lineno - 1
        while lines[above - 1].startswith("#"):
            above -= 1
        comment = lines[above : node.lineno - 1]
        _, _, beside = lines[(node.end_lineno or 1) - 1].partition("  # ")
        if comment or beside or node.lineno != last + 1:
            text = " ".join(line.lstrip("#: ") for line in comment or [beside])
            meaning = " ".join(text.split()).partition(". ")[0].rstrip(".")
        last = node.end_lineno or 0
        for target in ast.walk(node.targets[0]):
            if isinstance(target, ast.Name) and target.id.isupper():
                yield target.id, meaning


def _is_numeric(value: object) -> bool:
    parts = value if isinstance(value, tuple) else (value,)
    numbers = all(isinstance(x, int | float) and type(x) is not bool for x in parts)
    return numbers and any(parts)


@contextmanager
def replaced(constant: Constant, value: Value) -> Iterator[None]:
    """Another value of a constant, in its module and in those that import its name."""
    modules = [import_module(name) for name in users(constant)]
    before = constant.value
    try:
        for module in modules:
            setattr(module, constant.name, value)
        yield
    finally:
        for module in modules:
            setattr(module, constant.name, before)


def users(constant: Constant) -> tuple[str, ...]:
    """The module of a constant, and those that import its name."""
    own = f"{PACKAGE}.{constant.module}"
    return own, *_importers().get((own, constant.name), ())


@cache
def _importers() -> dict[tuple[str, str], list[str]]:
    """Modules by the module and the name that they import at their top."""
    root, found = Path(skfem_textile.__file__).parent, dict[Any, list[str]]()
    for file in root.rglob("*.py"):
        parts = (PACKAGE, *file.relative_to(root).with_suffix("").parts)
        module = ".".join(parts).removesuffix(".__init__")
        inside = module if file.stem == "__init__" else module.rpartition(".")[0]
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom):
                given = "." * node.level + (node.module or "")
                source = resolve_name(given, inside)
                for alias in node.names:
                    if not alias.asname and alias.name.isupper():
                        found.setdefault((source, alias.name), []).append(module)
    return found


def read_by(run: Callable[[], object]) -> frozenset[tuple[str, str]]:
    """Modules of the package, and the global names in the lines that a call runs."""
    lines = set[tuple[str, CodeType, int]]()

    def of_line(frame: FrameType, event: str, _: object) -> Any:
        if event == "line":
            lines.add((frame.f_globals["__name__"], frame.f_code, frame.f_lineno))
        return of_line

    def of_call(frame: FrameType, event: str, _: object) -> Any:
        ours = str(frame.f_globals.get("__name__")).startswith(PACKAGE)
        return of_line if ours else None

    before = sys.gettrace()
    sys.settrace(of_call)
    try:
        run()
    finally:
        sys.settrace(before)
    return frozenset(
        (module, step.argval)
        for module, code in {line[:2] for line in lines}
        for step in get_instructions(code)
        if step.opname == "LOAD_GLOBAL" and step.positions
        if (module, code, step.positions.lineno) in lines
    )


def forget() -> None:
    """Clear the caches of functions, whose values may depend on constants."""
    for name, module in list(sys.modules.items()):
        if name.startswith(PACKAGE):
            for content in list(vars(module).values()):
                if hasattr(content, "cache_clear"):
                    content.cache_clear()
