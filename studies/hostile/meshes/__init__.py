"""Damaged mesh files: files of sound meshes, their damage, and what comes of it."""
