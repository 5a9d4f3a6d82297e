"""Vectorised evaluation of the forms for all elements, on a fixed sparsity pattern."""
