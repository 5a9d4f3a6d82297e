"""The command line ``skfem-textile``."""

from . import interruption as interruption  # first: it ends imports without a message
