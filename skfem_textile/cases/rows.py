"""Values that depend on the load factor by rows of a table."""

from typing import Any

import numpy as np


class Rows:
    """Piecewise linear function of the load factor, constant beyond its rows.

    Parameters
    ----------
    what
        Its name in messages.
    rows
        Load factor and values of each row.

    Raises
    ------
    ValueError
        If the load factors do not increase from 0 to 1.
    """

    def __init__(self, what: str, rows: Any) -> None:
        self._t, *self._values = np.array(rows, dtype=float).T
        if (np.diff(self._t) <= 0).any() or self._t[0] != 0 or self._t[-1] != 1:
            raise ValueError(
                f"{what}: the load factors of the rows must increase from 0 to 1, got "
                f"{', '.join(f'{t:g}' for t in self._t)}"
            )

    def __call__(self, t: float) -> Any:
        """Value, or vector of values, at a load factor."""
        at = [float(np.interp(t, self._t, value)) for value in self._values]
        return np.array(at) if len(at) > 1 else at[0]
