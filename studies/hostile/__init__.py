"""Hostile inputs: refused in one line, or read as a plain reader reads them.

A trial is a seed.  A family makes an input from the seed, gives it to the library, and
compares the answer with the right one.  Trials run in forked workers with a time limit.
"""
