"""Inf-sup constants of formulations, and their inextensional modes."""
