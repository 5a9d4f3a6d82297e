"""Damaged files from which work goes on: checkpoints and files of sweeps."""
