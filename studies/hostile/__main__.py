"""``python -m studies.hostile --out DIR``: run the suite and write its counts."""

import argparse
import json
import os
import sys
from collections import Counter
from pathlib import Path

from .families import FAMILIES
from .tables import counts_by_family, table
from .trial import GOOD
from .workers import Tried, findings


def main() -> int:
    """Run the suite; 0 if every trial ended well."""
    options = _options()
    chosen = [f for f in FAMILIES if f.name in (options.family or [f.name])]
    tried: list[Tried] = []
    for family in chosen:
        number = family.short if options.short else family.trials
        seeds = range(options.first, options.first + number)
        some = list(findings(family, seeds, options.workers))
        counts = Counter(one.finding.outcome for one in some)
        print(f"{family.name:16}", dict(counts), flush=True)
        tried += sorted(some, key=lambda one: one.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    bad = [one for one in tried if one.finding.outcome not in GOOD]
    for one in bad:
        print(f"{one.family} {one.seed}: {one.finding}", file=sys.stderr)
    counts = counts_by_family(tried)
    (options.out / "hostile.json").write_text(json.dumps(counts, indent=2) + "\n")
    (options.out / "hostile.md").write_text(table(counts))
    return 1 if bad else 0


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
        help="these families only",
    )
    return parser.parse_args()


sys.exit(main())
