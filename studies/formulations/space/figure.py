"""The figure of the study of a ply in space."""

import os
from collections.abc import Sequence

from ...common.figures import colour_of, figure_of, marker_of
from ...study import Row


def draw_errors(rows: Sequence[Row], filename: str | os.PathLike[str]) -> None:
    """Errors of cantilevers and of plates over the number of element edges."""
    with figure_of((9.6, 4.2), filename) as figure:
        tips, plates = figure.subplots(1, 2, sharey=True)
        kinds = (
            (tips, "cantilever", ("formulation", "load"), "{0}, {1}"),
            (plates, "plate", ("formulation", "degrees", "jitter"), "{0}, {1}°"),
        )
        for axes, part, keys, label in kinds:
            own = [row for row in rows if row["part"] == part and "off_z" in row]
            for i, kind in enumerate(
                dict.fromkeys(tuple(row[key] for key in keys) for row in own)
            ):
                line = [row for row in own if tuple(row[k] for k in keys) == kind]
                moved = ", nodes moved" if part == "plate" and kind[2] else ""
                axes.loglog(
                    [row["n"] for row in line],
                    [abs(row["off_z"]) for row in line],
                    marker=marker_of(i),
                    color=colour_of(i),
                    label=label.format(*kind) + moved,
                )
            axes.set(xlabel="Element edges along the side")
            axes.set_xticks([8, 16, 32], ["8", "16", "32"])
            axes.minorticks_off()
            axes.grid(alpha=0.3)
            if own:
                axes.legend(frameon=False, fontsize=7)
        tips.set(ylabel="Error", title="Height of the tip over the length")
        plates.set(title="Deflection over the largest")
