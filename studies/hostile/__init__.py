"""Hostile inputs: each is answered in one line, or read as a plain reader reads it.

``python -m studies.hostile --out DIR`` runs every family of trials and writes the
counts by outcome.  A trial is a seed: a family makes its input from it, gives it to the
library, and judges the answer.  Trials run in forked workers with a time limit each.
"""
