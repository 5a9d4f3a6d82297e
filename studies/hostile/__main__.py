"""``python -m studies.hostile --out DIR``: run the suite and write its counts."""

import argparse
import json
import os
import sys
from pathlib import Path

from .families import FAMILIES
from .tables import Counts, counts_of, table
from .trial import GOOD
from .workers import findings


def main() -> int:
    """Run the suite; 0 if every trial ended well."""
    options = _options()
    chosen = [f for f in FAMILIES if f.name in (options.family or [f.name])]
    options.out.mkdir(parents=True, exist_ok=True)
    counts = _kept(options.out / "hostile.json") if options.family else {}
    well = True
    for family in chosen:
        number = family.short if options.short else family.trials
        seeds = range(options.first, options.first + number)
        tried = sorted(findings(family, seeds, options.workers), key=lambda x: x.seed)
        counts[family.name] = counts_of(tried)
        print(f"{family.name:16}", counts[family.name], flush=True)
        for one in tried:
            if one.finding.outcome not in GOOD:
                well = False
                print(f"{one.family} {one.seed}: {one.finding}", file=sys.stderr)
        (options.out / "hostile.json").write_text(json.dumps(counts, indent=2) + "\n")
        (options.out / "hostile.md").write_text(table(counts))
    return 0 if well else 1


def _kept(file: Path) -> dict[str, Counts]:
    """Counts of the families that are not run again."""
    return json.loads(file.read_text()) if file.is_file() else {}


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="studies.hostile", description=__doc__)
    add = parser.add_argument
    add("--out", type=Path, required=True, metavar="DIR", help="where counts go")
    add("--short", action="store_true", help="the short form, for continuous checks")
    add("--workers", type=int, default=os.cpu_count(), help="processes")
    add("--first", type=int, default=0, help="first seed")
    add(
        "--family",
        nargs="+",
        choices=[f.name for f in FAMILIES],
        help="these families only; the counts of others are kept",
    )
    return parser.parse_args()


sys.exit(main())
