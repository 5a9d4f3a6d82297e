"""Quantities of a summary that are read first, with names and units."""

from collections.abc import Mapping
from math import isfinite
from numbers import Real
from typing import Any, NamedTuple

# Values below which strains, angles and lengths are shown as round-off.
_ROUND_OFF = {"%": 1e-3, "°": 1e-3, "mm": 1e-6}

#: Relative rounding of values with four digits: printed intervals are not narrower.
ROUNDED = 1e-3

#: End of the key of the band of a quantity over further specimens of the fabric.
BAND = "_band"

# Maximum number of rows.  With the names of the files they are 15 lines.
_MOST = 14


class Quantity(NamedTuple):
    """Name and unit of an entry of a summary.

    Attributes
    ----------
    name
        Name in tables.
    key
        Key in the summary.
    unit
        Unit; shares are shown in %.  Empty for a text.
    place
        Position in mm, by the keys of its components without ``_x_mm``, ...; empty if
        there is none.
    has_interval
        True if it has an error interval, whose half-width is ``KEY_half_width``.
    note
        Words after the unit.
    at
        Words before the position.
    """

    name: str
    key: str
    unit: str = ""
    place: str = ""
    has_interval: bool = False
    note: str = ""
    at: str = " at"

    def declared(self) -> dict[str, Any]:
        """Fields other than the defaults, by name, for a summary."""
        left_out = self._field_defaults
        return {k: x for k, x in self._asdict().items() if x != left_out.get(k)}

    def text(self, summary: Mapping[str, Any]) -> str:
        """Value with unit, interval and position; empty if there is no value."""
        value = summary.get(self.key)
        if not self.unit:
            return "" if value is None else str(value)
        if not (isinstance(value, Real) and isfinite(value)):
            return ""
        value = float(value) * (100 if self.unit == "%" else 1)
        interval, reason = self._interval(value, summary)
        unit = self.unit if self.unit == "°" else f" {self.unit}"
        keys = [f"{self.place}_{axis}_mm" for axis in "xyz"]
        at = [round(summary[key], 1) + 0.0 for key in keys if key in summary]
        place = f"{self.at} ({', '.join(map(str, at))}) mm" if at else ""
        number = _rounded(value, 4)
        if self.unit in _ROUND_OFF and 0 < abs(value) < _ROUND_OFF[self.unit]:
            number = f"below {_ROUND_OFF[self.unit]:g}"
        band = self._band(summary)
        return f"{number}{interval}{unit}{self.note}{place}{reason}{band}"

    def _band(self, summary: Mapping[str, Any]) -> str:
        """Band over further specimens of the fabric; empty without one."""
        if self.key + BAND not in summary:
            return ""
        scale = 100 if self.unit == "%" else 1
        low, high = (_rounded(scale * x, 4) for x in summary[self.key + BAND])
        return f"; samples {low} to {high}"

    def _interval(self, value: float, summary: Mapping[str, Any]) -> tuple[str, str]:
        """Half-width of the value, or the reason why there is none."""
        if not self.has_interval:
            return "", ""
        if value == 0:
            return "", " within the tolerance of the equilibrium"
        half = summary.get(f"{self.key}_half_width")
        if half is not None:
            return f" ± {_rounded(max(half, ROUNDED * abs(value)), 2)}", ""
        reason = str(summary.get("error_interval")).partition("none")[2]
        return "", f"; no error interval{reason}"


def _rounded(value: float, digits: int) -> str:
    """Number with some digits, without an exponent up to 10¹⁵."""
    return f"{float(f'{value:.{digits}g}'):.15g}"


def band_rows(summary: Mapping[str, Any]) -> list[list[str]]:
    """Rows of the quantities with a band over further specimens of the fabric.

    Name with unit, value of the run, half-width of its error interval, which may be
    missing, and ends of the band.  Argument and errors as for `first_rows`.
    """
    rows = []
    for one in (Quantity(**fields) for fields in summary.get("first", ())):
        if (band := summary.get(one.key + BAND)) is None:
            continue
        half = summary.get(f"{one.key}_half_width")
        values = summary[one.key], half, *band
        scale = 100 if one.unit == "%" else 1
        cells = ["" if x is None else _rounded(scale * x, 4) for x in values]
        rows.append([f"{one.name} ({one.unit})", *cells])
    return rows


#: Largest shear angle of a ply in its plane, and in space.
IN_PLANE, IN_SPACE = (
    Quantity("Largest shear angle", key, "°", "max_shear_angle_at")
    for key in ("max_shear_angle_deg", "recovered_max_shear_angle_deg")
)

#: Energy lost by friction of laws and tools.
LOST = Quantity("Energy lost", "energy_lost", "N·mm")

#: Quantities of every ply that follow.
OF_PLY = (
    Quantity(
        *("Shear angle error", "shear_angle_error_deg", "°"),
        note=", root mean square over the ply",
    ),
    Quantity("Largest fibre strain", "max_fibre_strain", "%"),
    Quantity(
        *("Wrinkle risk", "wrinkle_risk_share_of_area", "%", "wrinkle_risk_at"),
        note=" of the area, where compressed fibres may buckle",
        at="; most compressed at",
    ),
)

#: Force handed over at crossings, of a fabric with yarns.
SLIP = Quantity(
    *("Slip index", "max_slip_index", "%"),
    note=" of the force that friction at a crossing bears",
)


def first_rows(summary: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Rows of the quantities that a summary declares in ``first``.

    Parameters
    ----------
    summary
        Summary of a result, or its copy from a file.

    Returns
    -------
    list
        At most 14 rows: name, ``bad`` or empty, and text.  Texts and warnings, which
        qualify the numbers, come first, then the numbers, and the run time.

    Raises
    ------
    TypeError
        If ``first`` is not a list of the fields of quantities.

    Examples
    --------
    >>> first = [Quantity("Load", "load_N", "N", has_interval=True).declared()]
    >>> first_rows({"load_N": 12.0, "load_N_half_width": 1.2, "first": first})
    [('Load', '', '12 ± 1.2 N'), ('Warnings', '', 'none')]
    >>> first_rows({"load_N": 12.0, "first": first[:1], "warnings": ["not stable"]})[0]
    ('Warning', 'bad', 'not stable')
    """
    rows: list[tuple[str, str, str]] = []
    texts: list[tuple[str, str, str]] = []
    for one in summary.get("first", ()):
        quantity = Quantity(**one)
        if text := quantity.text(summary):
            (rows if quantity.unit else texts).append((quantity.name, "", text))
    texts += [("Warning", "bad", str(text)) for text in summary.get("warnings", ())]
    if not texts:
        rows.append(("Warnings", "", "none"))
    if time := Quantity("Run time", "wall_time_s", "s").text(summary):
        rows.append(("Run time", "", time))
    if summary.get("converged") is False and summary.get("load_factor") != 1.0:
        stopped = f"at load factor {summary.get('load_factor'):.4g}, described here"
        texts.insert(0, ("Stopped early", "bad", stopped))
    most = _MOST - len(rows)
    if (surplus := len(texts) - most) > 0:
        texts[most - 1 :] = [("Warnings", "bad", f"{surplus + 1} more in summary.json")]
    return [*texts, *rows]
