"""Hostile inputs: refused in one line, or read as a plain reader reads them.

The families of inputs, and the claims about each, are property tests beside their
subjects in ``tests``.  The study tries many inputs of each family in forked workers,
which limit time and memory, and counts how they end.
"""
