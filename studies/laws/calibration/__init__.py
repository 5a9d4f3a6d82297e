"""Calibration of laws: confidence bands, inverse fits, two tests of one fabric."""
