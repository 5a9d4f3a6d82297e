"""Malformed input files: rejected on one line, or read as by a reference reader.

The families of inputs and the properties of each are property-based tests in
``tests``.  The study runs many inputs of each family in forked workers with limits on
time and memory, and counts the outcomes.
"""
