"""Style of all figures drawn with matplotlib."""

from contextlib import AbstractContextManager

import matplotlib as mpl

from .layout import TITLE


def figure_style(size: float = TITLE) -> AbstractContextManager[None]:
    """Context in which figures have one style, with text of a size in points.

    Examples
    --------
    >>> with figure_style():
    ...     mpl.rcParams["font.size"], mpl.rcParams["axes.spines.top"]
    (8.0, False)
    """
    return mpl.rc_context(
        {
            "font.size": size,
            "axes.titlesize": "medium",
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.linewidth": 0.6,
            "lines.linewidth": 1.0,
        }
    )
