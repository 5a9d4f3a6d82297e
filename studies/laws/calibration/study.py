"""Known laws and what calibration makes of their curves; the benchmark's curves.

``--benchmark DIR`` reads a copy of the curves of Cao et al. (2008) in the repository
guzmalalo/bias_test, its folder ``test_data``.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ...common.tables import csv_table, rows_of_csv
from ...study import Row, Study
from . import fits, tables
from .cases import Agreement, Benchmark, Case, Coverage, Inverse, RoundTrip, all_cases

# Files of the benchmark alone.
_BENCHMARK = "benchmark.csv", "benchmark.md"


class Calibration(Study[Case]):
    """Bands, inverse fits, agreement of tests, the way to a simulation and back."""

    files = (
        *("calibration.csv", "coverage.md", "inverse.md", "agreement.md"),
        *("round_trip.md", *_BENCHMARK),
    )
    pictures = ("fit.png",)
    sample = Agreement().name

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument(
            "--benchmark",
            type=Path,
            metavar="DIR",
            help="a folder with the benchmark's curves, glass_plain_115_230.csv and "
            "glass_plain_150_450.csv",
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        return all_cases(options.benchmark)

    def name(self, case: Case) -> str:
        return case.name

    def examine(self, case: Case) -> list[Row]:
        tasks: dict[type[Any], Callable[[Any], list[Row]]] = {
            Coverage: fits.covered,
            Inverse: fits.inverse,
            Agreement: lambda case: fits.agreement(),
            RoundTrip: fits.round_trip,
            Benchmark: fits.benchmark,
        }
        return tasks[type(case)](case)

    def line(self, rows: list[Row]) -> str:
        text = getattr(tables, rows[0]["task"].replace(" ", "_"))(rows)
        return "\n".join(text.splitlines()[2:])

    def tables(self, rows: list[Row]) -> dict[str, str]:
        texts = {
            "calibration.csv": csv_table([r for r in rows if r["task"] != "benchmark"]),
            "coverage.md": tables.coverage(rows),
            "inverse.md": tables.inverse(rows),
            "agreement.md": tables.agreement(rows),
            "round_trip.md": tables.round_trip(rows),
        }
        if own := tables.of(rows, "benchmark"):
            contents = csv_table(own), tables.benchmark(rows)
            texts |= dict(zip(_BENCHMARK, contents, strict=True))
        return texts

    def stored(self, folder: Path) -> list[Row]:
        """The rows of known laws and of the benchmark, each with the columns of its."""
        rows = super().stored(folder)
        benchmark = folder / _BENCHMARK[0]
        if benchmark.is_file():
            rows += rows_of_csv(benchmark.read_text(encoding="utf-8"))
        return rows

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return tables.in_words(rows)

    def draw(self, rows: list[Row], folder: Path) -> None:
        from skfem_textile.calibration.figure import draw

        draw(fits.example(), folder / "fit.png")

    def complaint(self, rows: list[Row]) -> str:
        missed = tables.missed(rows)
        return f"{len(missed)} target(s) missed, first: {missed[0]}" if missed else ""

    def written(self, cases: Sequence[Case]) -> list[str]:
        """The files of the benchmark are kept where its curves are not at hand."""
        has_benchmark = any(isinstance(case, Benchmark) for case in cases)
        names = (*self.files, *self.pictures)
        return [name for name in names if has_benchmark or name not in _BENCHMARK]


STUDY = Calibration()
