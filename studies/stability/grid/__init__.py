"""Load and linear solves against E/G and mesh distortion, with other codes."""
