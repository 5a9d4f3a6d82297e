"""Packages that only some abilities require: their extras and their messages."""

import contextlib
import io
import logging
import warnings
from collections.abc import Iterator
from importlib.util import find_spec


def is_installed(package: str) -> bool:
    """True if a package can be found; it is not imported."""
    return find_spec(package) is not None


def require(ability: str, extra: str, *packages: str) -> None:
    """Raise an error if a package that an ability requires is not installed.

    Parameters
    ----------
    ability
        The ability, as the subject of the message.
    extra
        Extra of this package that installs what is missing.
    packages
        Packages by the names by which they are imported.

    Raises
    ------
    ModuleNotFoundError
        With one line that names the ability, the packages and the extra.
    """
    missing = [package for package in packages if not is_installed(package)]
    if missing:
        raise ModuleNotFoundError(lacks(ability, extra, *missing), name=missing[0])


def lacks(ability: str, extra: str, *packages: str) -> str:
    """Line that an ability requires packages, with the command that installs them."""
    return (
        f"{ability} requires {', '.join(packages)}: pip install "
        f"'skfem-textile[{extra}]'"
    )


@contextlib.contextmanager
def without_messages() -> Iterator[None]:
    """Omit what other packages print, their warnings and log messages."""
    import numpy as np

    printed, disabled = io.StringIO(), logging.root.manager.disable
    logging.disable()
    try:
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
            warnings.catch_warnings(),
            np.errstate(all="ignore"),
        ):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(disabled)
