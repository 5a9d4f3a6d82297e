"""Friction with tools against exact solutions, its work, and its extremes."""
