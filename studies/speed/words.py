"""Results of the benchmarks in words, for prose."""

from collections.abc import Callable, Mapping

from ..study import Row
from . import modules, needs


def of(results: Mapping[str, Row]) -> dict[str, str]:
    """The words of all benchmarks.

    Parameters
    ----------
    results
        The results by benchmark.
    """
    words: dict[str, str] = {}
    for name, function in _WORDS.items():
        if name in results:
            words |= function(results[name])
    return words


def _iteration(results: Row) -> dict[str, str]:
    """Assembly over factorisation, and times of other codes over this library's."""
    name = "assembly over factorisation"
    shares = [x for key, x in results["ratios"].items() if key.startswith(name)]
    words = {"iteration_elements": _count(results["elements"])}
    if shares:
        words["assembly_over_factorisation"] = f"{min(shares):.2f} to {max(shares):.2f}"
    for key, ratio in results["ratios"].items():
        other, over, _ = key.partition(" over skfem_textile")
        if over:
            words[f"{other.split()[0].lower()}_over_this"] = f"{ratio:.1f}"
    return words


def _whole_strip(results: Row) -> dict[str, str]:
    """Linear solves and the ratio of the times."""
    return {
        "strip_elements": _count(results["elements"]),
        "strip_ratio": f"{results['stock_over_own']:.0f}",
        "strip_solves": str(results["own"]["linear_solves"]),
        "strip_stock_solves": str(results["stock"]["linear_solves"]),
        "strip_stock_steps": str(results["stock"]["steps"]),
    }


def _scaling(results: Row) -> dict[str, str]:
    """The largest mesh: its time in an iteration, its memory, and a load step on it."""
    last, step = results["sizes"][-1], results["step"]
    exponents = results["exponents"].values()
    return {
        "largest_unknowns": _count(last["unknowns"]),
        "largest_iteration": f"{last['iteration']:.1f} s",
        "largest_peak": f"{last['peak_GiB']:.1f} GiB",
        "largest_step": f"{step['seconds']:.0f} s",
        "exponents": f"{min(exponents):.2f} to {max(exponents):.2f}",
    }


def _iterative(results: Row) -> dict[str, str]:
    """Conjugate gradients over the direct solver with stiff fibres, and iterations."""
    stiff = max((row["E_over_G"] for row in results["sizes"]), default=0.0)
    ratios = [
        row["iterative_over_direct"]
        for row in results["sizes"]
        if row["E_over_G"] == stiff
    ]
    soft = [row["iterations"] for row in results["sizes"] if row["E_over_G"] != stiff]
    if not (ratios and soft):
        return {}
    return {
        "iterative_ratios": f"{min(ratios):.0f} to {max(ratios):.0f}",
        "soft_iterations": f"{min(soft)} to {max(soft)}",
    }


#: The words of each benchmark.
_WORDS: dict[str, Callable[[Row], dict[str, str]]] = {
    "needs": needs.figures,
    "modules": modules.figures,
    "iteration": _iteration,
    "whole_strip": _whole_strip,
    "scaling": _scaling,
    "iterative": _iterative,
}


def _count(number: int) -> str:
    """A whole number with thin gaps, as in the pages.

    Examples
    --------
    >>> _count(60000)
    '60 000'
    """
    return f"{number:,}".replace(",", " ")
