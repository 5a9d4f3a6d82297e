"""Load and linear solves by E/G and distortion of the mesh, beside other codes."""
