"""The machine and the versions with which times were taken."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from .rivals import with_dolfinx

_PACKAGES = (
    *("skfem-textile", "scikit-fem", "numpy", "scipy", "cvxopt"),
    *("pypardiso", "mkl", "felupe", "scikit-fem-native"),
)


def described() -> dict[str, Any]:
    """Processor, cores, threads and versions; None for a package that is missing."""
    versions = {name: _version(name) for name in _PACKAGES}
    there = with_dolfinx.interpreter()
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "threads": os.environ.get("OMP_NUM_THREADS", "as many as cores"),
        "system": f"{platform.system()} on {platform.machine()}",
        "python": platform.python_version(),
        "packages": versions | {"dolfinx": there and there[1]},
    }


def sentence(machine: dict[str, Any]) -> str:
    """The same in words."""
    packages = machine["packages"].items()
    there = ", ".join(f"{name} {version}" for name, version in packages if version)
    return (
        f"Machine: {machine['processor']}, {machine['cores']} cores, "
        f"OMP_NUM_THREADS: {machine['threads']}; {machine['system']}, "
        f"Python {machine['python']}, {there}."
    )


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    names = [x.partition(":")[2].strip() for x in lines if x.startswith("model name")]
    return names[0] if names else platform.processor()
