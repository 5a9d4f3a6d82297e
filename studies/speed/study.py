"""Benchmarks, each in a process of its own, on one thread.

A benchmark is a module with `measured`, whose results go to a file of JSON, and
`tables` of these results.  Each row of the study is a benchmark with its results.
"""

import argparse
import json
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from ..common import machine_and_versions
from ..common.tables import json_text
from ..common.workers import in_new_process
from ..study import Row, Study
from . import needs, words
from .measuring import Settings

BENCHMARKS = (
    *("needs", "modules", "iteration", "scaling", "iterative"),
    *("whole_strip", "overhead"),
)


class Benchmark(NamedTuple):
    """A benchmark with its settings."""

    name: str
    settings: Settings

    @property
    def module(self) -> ModuleType:
        """The module with the functions of the benchmark."""
        return import_module(f"studies.speed.{self.name}")


class Speed(Study[Benchmark]):
    """Every benchmark."""

    pictures = needs.PICTURES
    timed = True

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        defaults = Settings()
        add = parser.add_argument
        add(
            "--most", type=int, default=defaults.most, help="no more elements than that"
        )
        add("--solver", default=defaults.solver, help="of one step, and of scaling")
        add("--before", default="", metavar="DIR", help="a checkout of this project")
        add("--after", default="", metavar="DIR", help="another: compared by turns")

    def cases(self, options: argparse.Namespace) -> list[Benchmark]:
        given = {name: getattr(options, name) for name in Settings._fields}
        compared = ("by_turns",) if options.before and options.after else ()
        return [Benchmark(name, Settings(**given)) for name in BENCHMARKS + compared]

    def name(self, case: Benchmark) -> str:
        return case.name

    def examine(self, case: Benchmark) -> list[Row]:
        """The results of a benchmark and its machine, as a row."""
        results = in_new_process(case.module.measured, case.settings)
        machine = machine_and_versions.described()
        return [{"benchmark": case.name, "machine": machine, "results": results}]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        return "\n".join([f"{row['benchmark']}:", *_tables(row).values()])

    def tables(self, rows: list[Row]) -> dict[str, str]:
        texts = {}
        for row in rows:
            content = {"machine": row["machine"], **row["results"]}
            texts[f"{row['benchmark']}.json"] = json_text(content)
            texts |= _tables(row)
        return texts

    def stored(self, folder: Path) -> list[Row]:
        files = (folder / f"{name}.json" for name in BENCHMARKS)
        every = {f.stem: json.loads(f.read_text("utf-8")) for f in files if f.is_file()}
        if not every:
            raise FileNotFoundError(f"{folder} has no results of benchmarks")
        return [
            {"benchmark": name, "machine": content.pop("machine"), "results": content}
            for name, content in every.items()
        ]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        machines = (machine_and_versions.sentence(row["machine"]) for row in rows)
        results = {row["benchmark"]: row["results"] for row in rows}
        return {"machines": " ".join(dict.fromkeys(machines)), **words.of(results)}

    def draw(self, rows: list[Row], folder: Path) -> None:
        results = {row["benchmark"]: row["results"] for row in rows}
        for name in self.pictures:
            needs.draw(results["needs"], folder / name)

    def written(self, cases: Sequence[Benchmark]) -> list[str]:
        """Results, tables and pictures of these benchmarks."""
        names = [f"{case.name}.json" for case in cases]
        for case in cases:
            names += case.module.TABLES
            names += self.pictures if case.name == "needs" else ()
        return names


STUDY = Speed()


def _tables(row: Row) -> dict[str, str]:
    module = Benchmark(row["benchmark"], Settings()).module
    texts: dict[str, str] = module.tables(row["results"])
    return texts
