"""Bias extension on nets along the singular fibres, for all codes: 8 min."""
