"""The command line ``skfem-textile``."""

from .main import main

__all__ = ["main"]
