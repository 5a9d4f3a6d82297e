"""Stiff and extreme drapes: which end right, which are refused, and which are wrong."""
