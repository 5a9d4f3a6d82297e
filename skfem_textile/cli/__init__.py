"""The command line ``skfem-textile``: arguments, and what they build."""
