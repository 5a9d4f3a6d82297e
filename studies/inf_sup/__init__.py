"""Inf-sup constants of formulations, and their motions that stretch no fibre."""
