"""Predictions of published measurements, with laws from other tests."""
