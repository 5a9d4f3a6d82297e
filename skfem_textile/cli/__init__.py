"""The command line ``skfem-textile``."""
