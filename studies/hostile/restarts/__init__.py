"""Damaged files from which runs and sweeps resume: checkpoints, files of sweeps."""
