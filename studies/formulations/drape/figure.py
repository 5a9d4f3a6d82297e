"""Error against run time with matplotlib."""

import os
from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ...common.figures import colour_of, figure_of, legend, marker_of
from ...study import Row
from .cases import EXPONENTIAL, FROM_NET, GROWTH


def error_against_time(
    rows: Sequence[Row], filename: str | os.PathLike[str] | None = None
) -> Figure:
    """Root-mean-square error against time, a panel for each start."""
    starts = EXPONENTIAL, FROM_NET, GROWTH
    names = list(dict.fromkeys(row["formulation"] for row in rows))
    handles = {}
    with figure_of((8.8, 3.4), filename) as figure:
        panels = figure.subplots(1, len(starts), sharex=True, sharey=True)
        for axes, start in zip(panels, starts, strict=True):
            axes.set(
                xscale="log", yscale="log", title=f"start: {start}", xlabel="seconds"
            )
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.grid(alpha=0.3)
            for i, name in enumerate(names):
                own = [
                    (row["seconds"], row["rms"])
                    for row in rows
                    if (row["formulation"], row["start"]) == (name, start)
                    and not row["refused"]
                ]
                if own:
                    style = {"color": colour_of(i), "marker": marker_of(i)}
                    (handles[name],) = axes.plot(
                        *zip(*own, strict=True), **style, label=name
                    )
        panels[0].set_ylabel("error of Γ in °, root mean square")
        legend(figure, list(handles.values()), len(handles))
    return figure
