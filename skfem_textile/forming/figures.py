"""Figures of a formed ply: gaps, draw-in, areal weight."""

from ..solve.result import Result


def formed(result: Result) -> dict[str, float | str]:
    """Figures of the last state of a ply between tools, in N, mm and degrees."""
    ply, state = result.ply, result.states[-1]
    return {
        f"{x.name}_gap_mm": float(x.gaps(state.u, state.load_factor).min())
        for x in ply.terms
        if hasattr(x, "gaps")
    }
