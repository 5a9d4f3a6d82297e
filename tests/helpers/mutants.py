"""Single-line changes of the package, each of which a test should find.

    python -m tests.helpers.mutants --seed 1 --count 120 --out mutants.csv

draws changes by a seed: of signs, factors, indices, families, terms and limits, equally
many of each kind and spread over the folders.  Each is written into a copy of the
checkout, where the tests of its folder run, those first that name its module; with
``--lane``, all tests of the library run for those that survive.  Rows of an existing
file are not run again.
"""

import ast
import csv
import os
import shutil
import subprocess
import sys
import tempfile
from argparse import ArgumentParser
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from random import Random
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "skfem_textile"

_OTHER = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
_FAMILIES = {"warp": "weft", "weft": "warp", "left": "right", "right": "left"}


class Mutant(NamedTuple):
    """Text at a place of a file, and the text that replaces it."""

    kind: str
    file: str
    line: int
    start: int
    end: int
    text: str

    def changed(self) -> bytes:
        """The whole file with the change."""
        lines = (ROOT / self.file).read_bytes().split(b"\n")
        old = lines[self.line - 1]
        lines[self.line - 1] = old[: self.start] + self.text.encode() + old[self.end :]
        return b"\n".join(lines)


def mutants(file: Path) -> Iterator[Mutant]:
    """All changes of a file."""
    source = file.read_text(encoding="utf-8")
    name = file.relative_to(ROOT).as_posix()

    def of(kind: str, first: ast.expr, last: ast.expr, text: str) -> Iterator[Mutant]:
        if first.lineno == last.end_lineno:
            place = first.lineno, first.col_offset, last.end_col_offset
            yield Mutant(kind, name, *place, text)

    def code(node: ast.AST) -> str:
        return ast.get_source_segment(source, node) or ""

    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.BinOp(left=a, op=op, right=b) if type(op) in _OTHER:
                if isinstance(a, ast.Constant) and isinstance(a.value, str):
                    continue
                kind = "sign" if isinstance(op, ast.Add | ast.Sub) else "factor"
                yield from of(kind, a, b, f"{code(a)} {_OTHER[type(op)]} {code(b)}")
                if kind == "sign":
                    yield from of("term", a, b, code(a))
            case ast.UnaryOp(op=ast.USub(), operand=x):
                if not isinstance(x, ast.Constant):
                    yield from of("sign", node, node, code(x))
            case ast.Subscript(slice=ast.Constant(value=0 | 1 as i) as x):
                if not isinstance(i, bool):
                    yield from of("index", x, x, str(1 - i))
            case ast.Attribute(value=x, attr=name_) if name_ in _FAMILIES:
                yield from of("family", node, node, f"{code(x)}.{_FAMILIES[name_]}")
            case ast.Name(id=name_) if name_ in _FAMILIES:
                yield from of("family", node, node, _FAMILIES[name_])
            case ast.Assign(
                targets=[ast.Name(id=name_)],
                value=ast.Constant(value=int() | float()) as x,
            ) if name_.isupper():
                yield from of("limit", x, x, f"100 * {code(x)}")


def drawn(seed: int, count: int) -> list[Mutant]:
    """Changes drawn by a seed, of all kinds and folders in turn."""
    random = Random(seed)
    by_kind: dict[str, dict[str, list[Mutant]]] = defaultdict(lambda: defaultdict(list))
    for file in sorted(PACKAGE.rglob("*.py")):
        for mutant in mutants(file):
            by_kind[mutant.kind][_folder(mutant)].append(mutant)
    chosen: list[Mutant] = []
    while len(chosen) < count:
        folders = by_kind[sorted(by_kind)[len(chosen) % len(by_kind)]]
        of_folder = folders[random.choice(sorted(folders))]
        mutant = random.choice(of_folder)
        if mutant not in chosen and _is_python(mutant.changed()):
            chosen.append(mutant)
    return chosen


def _is_python(source: bytes) -> bool:
    """Places within f-strings are wrong before Python 3.12."""
    try:
        ast.parse(source)
    except SyntaxError:
        return False
    return True


def _folder(mutant: Mutant) -> str:
    """Name of the folder of its tests."""
    name = Path(mutant.file).parts[1].removesuffix(".py")
    return name if (ROOT / "tests" / name).is_dir() else "common"


def survives(mutant: Mutant, lane: bool) -> bool:
    """True if the tests of its folder, or of the lane, pass in a changed checkout."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "checkout"
        keep = shutil.ignore_patterns(".*", "_build", "gallery", "models", "generated")
        shutil.copytree(ROOT, root, ignore=keep)
        (root / mutant.file).write_bytes(mutant.changed())
        where = root / "tests" / ("" if lane else _folder(mutant))
        stem = Path(mutant.file).stem
        files = sorted(
            where.rglob("test_*.py"),
            key=lambda file: (stem not in f"{file.stem} {file.read_text()}", file),
        )
        run = subprocess.run(
            [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", *files],
            cwd=root,
            env={**os.environ, "PYTHONPATH": str(root), "CI": "true"},
            capture_output=True,
            check=False,
        )
    return run.returncode == 0


def verdict(mutant: Mutant, lane: bool) -> str:
    """Which tests find a change."""
    if not survives(mutant, False):
        return "found"
    if not lane:
        return "survived"
    return "survived all" if survives(mutant, True) else "found by lane"


def main() -> None:
    """Draw changes, run the tests of each, and write a row for each."""
    parser = ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--out", type=Path, default=Path("mutants.csv"))
    parser.add_argument("--lane", action="store_true")
    parser.add_argument("--workers", type=int, default=1, help="mutants at a time")
    given = parser.parse_args()
    known = {}
    if given.out.exists():
        with given.out.open(newline="", encoding="utf-8") as stored:
            known = {tuple(row[:6]): row for row in csv.reader(stored)}
    again = [("survived",)] if given.lane else []
    keys = {tuple(map(str, x)): x for x in drawn(given.seed, given.count)}
    left = [x for x in keys if x not in known or tuple(known[x][6:]) in again]
    with ThreadPoolExecutor(given.workers) as pool:
        run = partial(verdict, lane=given.lane)
        for key, found in zip(left, pool.map(run, map(keys.get, left)), strict=True):
            known[key] = [*key, found]
            with given.out.open("w", newline="", encoding="utf-8") as stored:
                csv.writer(stored).writerows(known.values())
            print(*known[key], flush=True)
    verdicts = [row[6] for row in known.values()]
    print({name: verdicts.count(name) for name in sorted(set(verdicts))})


if __name__ == "__main__":
    main()
