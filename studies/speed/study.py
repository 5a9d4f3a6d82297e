"""Benchmarks, each in a process of its own, on one thread.

A benchmark is a module with `measured`, whose results go to a file of JSON, and
`tables` of these results.
"""

import argparse
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType
from typing import NamedTuple

from ..common import machine_and_versions
from ..common.tables import json_text
from ..common.workers import in_new_process
from ..study import Row, Study
from .measuring import Settings

BENCHMARKS = "needs", "iteration", "scaling", "iterative", "whole_strip", "overhead"


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
            sentence = machine_and_versions.sentence(row["machine"])
            texts["machine.md"] = f"{sentence}\n"
        return texts

    def written(self, cases: Sequence[Benchmark]) -> list[str]:
        tables = [name for case in cases for name in case.module.TABLES]
        return [*(f"{case.name}.json" for case in cases), *tables, "machine.md"]


STUDY = Speed()


def _tables(row: Row) -> dict[str, str]:
    module = Benchmark(row["benchmark"], Settings()).module
    texts: dict[str, str] = module.tables(row["results"])
    return texts
