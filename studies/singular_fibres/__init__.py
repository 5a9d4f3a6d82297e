"""Meshes along the singular fibres: load errors, unknowns and run times."""
