"""Tables of the study, as functions of its rows."""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from ..common.tables import Row, grouped, having, markdown_table, percent, span
from .angle import departures, measured, onset, specimen
from .normalised import ANGLES as NORMALISED
from .published import BIAS, FABRICS, FRAMES, fibre_stiffnesses
from .shear import ANGLES, STIFFNESSES

#: Shear angle in degrees beyond which forces are compared by their ratio.
RATIO_FROM = 5.0


def array(rows: Sequence[Row], key: str) -> ndarray:
    """A column as numbers."""
    return np.array([row[key] for row in rows], dtype=float)


def inside(rows: Sequence[Row], *halves: str) -> int:
    """Number of measured points within the sum of half-widths."""
    off = np.abs(array(rows, "measured") - array(rows, "predicted"))
    return int(np.sum(off <= np.sum([array(rows, half) for half in halves], axis=0)))


def ratios(rows: Sequence[Row]) -> ndarray:
    """Predicted over measured forces, beyond small angles."""
    late = [row for row in rows if row["angle"] > RATIO_FROM]
    return array(late, "predicted") / array(late, "measured")


def laws(rows: list[Row]) -> str:
    """Moments of the laws with their bands."""
    lines = []
    for (fabric, test), group in grouped(rows, "fabric", "test").items():
        cells = [
            f"{1e3 * r['moment']:.1f} ± {1e3 * r['mean_half']:.1f} "
            f"(± {1e3 * r['specimen_half']:.0f}); {1e3 * r['tabulated']:.1f}"
            for r in group
        ]
        lines.append([fabric, f"{test}s", group[0]["specimens"], *cells])
    head = ["fabric", "law of", "curves", *(f"{angle}°" for angle in ANGLES)]
    return markdown_table(head, lines)


def misaligned(rows: list[Row]) -> str:
    """Misalignment of fibres that makes picture frames as stiff as measured.

    Fibres held at an angle α to the sides of a frame have the strain ½ ln(1 + sin 2α
    sin γ), about α sin γ, and add E α² sin γ cos γ to the moment.
    """
    lines = []
    for fabric in FABRICS:
        line: list[object] = [fabric]
        for angle in ANGLES[1:]:
            at = having(rows, fabric=fabric, angle=angle)
            by_test = {row["test"]: row["moment"] for row in at}
            if by_test.keys() != {FRAMES, BIAS}:
                return ""
            gamma, more = np.radians(angle), by_test[FRAMES] - by_test[BIAS]
            E = sum(fibre_stiffnesses(fabric))
            alpha = np.sqrt(more / (E * np.sin(gamma) * np.cos(gamma)))
            ratio = by_test[FRAMES] / by_test[BIAS]
            line.append(f"{ratio:.1f}; {np.degrees(alpha):.2f}°")
        lines.append(line)
    return markdown_table(["fabric", *(f"{angle}°" for angle in ANGLES[1:])], lines)


def sets(rows: list[Row]) -> str:
    """Points inside the bands, and ratios of forces, by fabric and law."""
    lines = []
    for test, law in ((BIAS, FRAMES), (BIAS, BIAS), (FRAMES, BIAS)):
        for fabric in FABRICS:
            if group := having(rows, fabric=fabric, test=test, law=law):
                lines.append(_line_of_set(test, law, fabric, group))
    head = ["predicted", "law of", "fabric", "curves", "points"]
    head += ["in the band of a specimen", "of the mean", "of the mesh alone"]
    head += ["predicted ÷ measured: median", "range"]
    head += ["half, twice the fibre stiffness", "largest mesh interval"]
    return markdown_table(head, lines)


def _line_of_set(test: str, law: str, fabric: str, rows: list[Row]) -> list[object]:
    found, others = ratios(rows), "other " if test == law else ""
    half, twice = (
        max(array(rows, f"stiffness_{times}"), key=abs) for times in ("0.5", "2")
    )
    mesh = (array(rows, "mesh_half") / array(rows, "predicted")).max()
    return [
        *(f"{test}s", f"{others}{law}s", fabric),
        *(len(grouped(rows, "name")), len(rows)),
        inside(rows, "specimen_half", "mesh_half"),
        inside(rows, "mean_half", "mesh_half"),
        inside(rows, "mesh_half"),
        *(f"{np.median(found):.2f}", span(found, ".2f")),
        f"{percent(half, '+.1f')}, {percent(twice, '+.1f')}",
        percent(mesh, ".2f"),
    ]


def each(test: str, rows: list[Row]) -> str:
    """Points inside the bands, and ratios of forces, of each test."""
    lines = []
    of_test = having(rows, test=test)
    for (fabric, name), group in grouped(of_test, "fabric", "name").items():
        line: list[object] = [fabric, name]
        for of_law in grouped(group, "law").values():
            within = inside(of_law, "specimen_half", "mesh_half")
            line += [f"{within} of {len(of_law)}", span(ratios(of_law), ".2f")]
        lines.append(line)
    if not lines:
        return ""
    laws_of = list(grouped(of_test, "law"))
    head = ["fabric", "specimen" if test == BIAS else "laboratory"]
    for law in laws_of:
        what = f"other {law}s" if law == test else f"{law}s"
        head += [f"law of {what}: inside", "predicted ÷ measured"]
    return markdown_table(head, lines)


def bias_extensions(rows: list[Row]) -> str:
    """All bias extensions."""
    return each(BIAS, rows)


def frames(rows: list[Row]) -> str:
    """All picture frames."""
    return each(FRAMES, rows)


def normalised(rows: list[Row]) -> str:
    """Factors of Eq. 18 at some angles, and their limit."""
    lines = []
    for angle in NORMALISED:
        line: list[object] = [f"{angle}°"]
        at = having(rows, angle=angle)
        for fabric in FABRICS:
            factors = array(having(at, fabric=fabric), "factor")
            if not factors.size:
                return ""
            within = f"{factors.min():.2f} to {factors.max():.2f}"
            line.append(f"{np.median(factors):.2f} ({within})")
        lines.append([*line, f"{at[0]['limit']:.2f}"])
    return markdown_table(["shear angle", *FABRICS, "at most, by Eq. 18"], lines)


def nylon(rows: list[Row]) -> str:
    """Differences of the nylon strips by direction."""
    lines = []
    for direction, group in grouped(rows, "direction").items():
        off = array(group, "predicted") / array(group, "measured") - 1
        lamina = array(group, "lamina") / array(group, "measured") - 1
        low, high = (percent(x, "+.0f") for x in (off.min(), off.max()))
        lines.append(
            [
                f"{direction}°",
                "fitted" if group[0]["fitted"] else "predicted",
                f"{low} to {high}",
                f"{inside(group, 'mean_half')} of {len(group)}",
                percent(max(array(group, "per_degree"), key=abs), "+.1f"),
                f"{percent(lamina.min(), '+.0f')} to {percent(lamina.max(), '+.0f')}",
            ]
        )
    head = ["direction", "", "difference of the force", "inside the 95 % band"]
    head += ["change by 1° of the cut", "lamina fitted by the authors to all seven"]
    return markdown_table(head, lines)


def temperature(rows: list[Row]) -> str:
    """Forces at two temperatures and speeds, and of the same test in Fig. 38."""
    names = [name for name in rows[0] if name not in ("case", "test", "angle")]
    lines = [
        [f"{r['angle']}°", *("-" if r[n] is None else f"{r[n]:.2f} N" for n in names)]
        for r in rows
    ]
    heads = [name.replace("_per_", "/").replace("_", ", ") for name in names]
    heads = [head.replace("C", " °C").replace("mm/", " mm/") for head in heads]
    heads = [head.replace("fig, ", "Fig. ") for head in heads]
    return markdown_table(["shear angle", *heads], lines)


def angle(rows: list[Row]) -> str:
    """Measured and predicted shear angles of one specimen by displacement."""
    finest = next(iter(grouped(rows, "density").values()))
    moved, by_test = measured()
    slack = specimen(None).slack
    lines = []
    for row in finest[1::2]:
        at = row["displacement"]
        angles = [
            np.degrees(np.interp(x, moved, by_test)) if x <= moved[-1] else None
            for x in (at, at + slack)
        ]
        texts = ["-" if x is None else f"{x:.1f}°" for x in angles]
        lines.append(
            [
                f"{at:.1f} mm",
                f"{row['pin_jointed']:.1f}°",
                *(f"{row[key]:.1f}°" for key in ("zone", "centre")),
                *texts,
                f"{row['max_slip_index']:.2f}",
                percent(row["slip_share_of_area"], ".1f"),
            ]
        )
    head = ["displacement", "inextensible net", "model, zone C", "model, centre"]
    head += ["measured", "measured, less slack", "slip index", "area above 1"]
    return markdown_table(head, lines)


def onsets(rows: list[Row]) -> str:
    """Onset of slip on two meshes against departures of the measured angle."""
    lines = []
    for density, group in grouped(rows, "density").items():
        found = departures(group)
        others = (onset(group, f"slip_{times:g}", 1.0) for times in STIFFNESSES)
        lines.append(
            [
                f"{density:g}",
                f"{onset(group, 'max_slip_index', 1.0):.1f}°",
                ", ".join(f"{x:.1f}°" for x in others),
                f"{onset(group, 'slip_share_of_area', 0.01):.1f}°",
                *(f"{x:.1f}°" for x in (found.raw, found.net, found.model)),
                f"{found.slack:.1f} mm, {found.model_slack:.1f} mm",
            ]
        )
    head = ["mesh density", "slip index 1 on one crossing"]
    head += ["with half, twice the fibre stiffness", "on 1 % of the area"]
    head += ["measured angle 2° below: the net", "the net, less slack"]
    head += ["the model, less slack", "slack by the net, by the model"]
    return markdown_table(head, lines)
